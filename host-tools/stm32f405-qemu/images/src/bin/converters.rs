//! A PWM with complementary outputs, an edge that a wire leads to a capture, and the second and third
//! converter, by embassy's drivers.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_stm32::adc::{Adc, AdcChannel, CONTINUOUS, Exten, SampleTime};
use embassy_stm32::gpio::{Level, Output, OutputType, Pull, Speed};
use embassy_stm32::time::khz;
use embassy_stm32::timer::complementary_pwm::{ComplementaryPwm, ComplementaryPwmPin};
use embassy_stm32::timer::input_capture::{CapturePin, InputCapture};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{CaptureCompareInterruptHandler, Channel};
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embassy_time::Timer;
use stm32f405_qemu_images::done;

bind_interrupts!(struct Irqs {
    TIM1_CC => CaptureCompareInterruptHandler<peripherals::TIM1>;
    TIM4 => CaptureCompareInterruptHandler<peripherals::TIM4>;
    DMA2_STREAM0 => dma::InterruptHandler<peripherals::DMA2_CH0>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(Default::default());

    let mut pwm = ComplementaryPwm::new(
        p.TIM1,
        Some(PwmPin::new(p.PA8, OutputType::PushPull)),
        Some(ComplementaryPwmPin::new(p.PA7, OutputType::PushPull)),
        None,
        None,
        None,
        None,
        None,
        None,
        khz(10),
        CountingMode::EdgeAlignedUp,
    );
    pwm.set_dead_time(100);
    let full = pwm.get_max_duty();
    pwm.set_duty(Channel::Ch1, full / 4);
    pwm.enable(Channel::Ch1);
    defmt::info!("a period of {} clocks", full);

    // A wire leads PC0 to PB6.
    let mut out = Output::new(p.PC0, Level::Low, Speed::Low);
    let input = CapturePin::new(p.PB6, Pull::None);
    let mut capture = InputCapture::new(
        p.TIM4,
        Some(input),
        None,
        None,
        None,
        Irqs,
        khz(100),
        CountingMode::EdgeAlignedUp,
    );
    let edges = async {
        let first = capture.wait_for_rising_edge(Channel::Ch1).await;
        let second = capture.wait_for_rising_edge(Channel::Ch1).await;
        second.wrapping_sub(first)
    };
    let pulses = async {
        for _ in 0..2 {
            Timer::after_millis(10).await;
            out.toggle();
            Timer::after_millis(10).await;
            out.toggle();
        }
    };
    let (apart, ()) = embassy_futures::join::join(edges, pulses).await;
    defmt::info!("{} us from edge to edge", 10 * u32::from(apart));

    let mut second = Adc::new(p.ADC2);
    let mut pin = p.PC4;
    defmt::info!(
        "ADC2 reads {} at PC4",
        second.blocking_read(&mut pin, SampleTime::CYCLES112)
    );

    let mut ring = [0; 8];
    let channels = [p.PC1.degrade_adc(), p.PC2.degrade_adc()].map(|pin| (pin, SampleTime::CYCLES56));
    let third = Adc::new(p.ADC3);
    let mut third = third.into_ring_buffered(
        p.DMA2_CH0,
        &mut ring,
        Irqs,
        channels.into_iter(),
        CONTINUOUS,
        Exten::DISABLED,
    );
    let mut codes = [0; 4];
    third.start();
    third.read(&mut codes).await.ok().expect("no code was lost");
    defmt::info!("ADC3 reads {}", codes);
    done();
}
