//! Random numbers, a checksum, the calendar and the window watchdog, by embassy's drivers. The watchdog
//! resets the part once; the calendar and a backup register survive that.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_stm32::crc::Crc;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource,
    Sysclk,
};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::rtc::{DateTime, DayOfWeek, Rtc, RtcConfig};
use embassy_stm32::time::Hertz;
use embassy_stm32::wdg::WindowWatchdog;
use embassy_stm32::{bind_interrupts, peripherals};
use embassy_time::{Duration, Ticker, Timer};
use stm32f405_qemu_images::{RCC, done, read};

bind_interrupts!(struct Irqs {
    RNG => rng::InterruptHandler<peripherals::RNG>;
});

const RCC_CSR: usize = RCC + 0x74;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse {
        freq: Hertz(8_000_000),
        mode: HseMode::Oscillator,
    });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.ls = LsConfig::default_lse();
    let p = embassy_stm32::init(config);

    let (mut rtc, time) = Rtc::new(p.RTC, RtcConfig::default());
    if rtc.read_backup_register(3) == Some(42) {
        let date = time.now().expect("the calendar goes on");
        defmt::info!(
            "again at {}-{}-{} {}:{}:{}, window watchdog {}",
            date.year(),
            date.month(),
            date.day(),
            date.hour(),
            date.minute(),
            date.second(),
            read(RCC_CSR) >> 30 & 1
        );
        done();
    }

    let mut random = Rng::new(p.RNG, Irqs);
    let mut words = [[0; 8]; 2];
    for word in &mut words {
        random.async_fill_bytes(word).await.expect("the clock is right");
    }
    defmt::info!("random: different {}", words[0] != words[1]);
    let words = words.map(|word| word.map(u32::from));
    defmt::info!("first byte {}", words[0][0]);
    let checksum = Crc::new(p.CRC).feed_words(&[0x3132_3334, 0x3536_3738]);
    defmt::info!("checksum {=u32:#x}", checksum);

    let date = DateTime::from(2026, 2, 28, DayOfWeek::Saturday, 23, 59, 58, 0).expect("there is one");
    rtc.set_datetime(date).expect("it is in range");
    Timer::after_millis(2500).await;
    let date = time.now().expect("the calendar goes on");
    defmt::info!(
        "{}-{} {}:{}:{}",
        date.month(),
        date.day(),
        date.hour(),
        date.minute(),
        date.second()
    );
    rtc.write_backup_register(3, 42);

    // 10 ms, and not in the first 4.
    let mut watchdog = WindowWatchdog::new(p.WWDG, 10_000, 4_000);
    let mut feeds = Ticker::every(Duration::from_millis(6));
    for _ in 0..20 {
        feeds.next().await;
        watchdog.pet();
    }
    defmt::info!("fed");
    feeds.next().await;
    feeds.next().await;
    defmt::info!("never here");
    done();
}
