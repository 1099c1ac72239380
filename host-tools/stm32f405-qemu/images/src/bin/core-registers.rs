//! Registers of the processor itself: priorities, the cycle counter, SysTick, and the state of the trace
//! port.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{done, read, write};

const NVIC_IPR7: usize = 0xe000_e41c;
const SHPR3: usize = 0xe000_ed20;
const DEMCR: usize = 0xe000_edfc;
const DWT_CTRL: usize = 0xe000_1000;
const DWT_CYCCNT: usize = 0xe000_1004;
const SYST_CSR: usize = 0xe000_e010;
const SYST_RVR: usize = 0xe000_e014;
const SYST_CVR: usize = 0xe000_e018;
const ITM_STIM0: usize = 0xe000_0000;
const NVIC_ISPR2: usize = 0xe000_e208;

#[cortex_m_rt::entry]
fn main() -> ! {
    for register in [NVIC_IPR7, SHPR3] {
        write(register, 0xff18_0808);
        defmt::info!("priorities {=u32:#010x}", read(register));
        write(register, 0);
    }
    defmt::info!("pending {=u32:#x}", read(NVIC_ISPR2));

    let passed = || {
        let before = read(DWT_CYCCNT);
        cortex_m::asm::delay(1000);
        read(DWT_CYCCNT).wrapping_sub(before)
    };
    write(DWT_CTRL, 1);
    defmt::info!("cycles without TRCENA: {}", passed() > 0);
    write(DEMCR, 1 << 24);
    defmt::info!("cycles with TRCENA: {}", passed() > 0);

    // Both count HCLK.
    write(SYST_RVR, 0x00ff_ffff);
    write(SYST_CVR, 0);
    write(SYST_CSR, 0b101);
    let before = (read(SYST_CVR), read(DWT_CYCCNT));
    cortex_m::asm::delay(100_000);
    let after = (read(SYST_CVR), read(DWT_CYCCNT));
    let (ticks, cycles) = (
        before.0.wrapping_sub(after.0) & 0x00ff_ffff,
        after.1.wrapping_sub(before.1),
    );
    defmt::info!(
        "SysTick as fast as CYCCNT: {}",
        ticks.abs_diff(cycles) < 10 && cycles > 10_000
    );

    defmt::info!("trace port ready: {}", read(ITM_STIM0) & 1 == 1);
    done();
}
