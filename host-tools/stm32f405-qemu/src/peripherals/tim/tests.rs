//! Counting, compares, captures, outputs and triggers of one timer.

use super::super::peripheral::Access;
use super::*;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0c;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;
const CCR1: u32 = 0x34;

/// 84 MHz, a period of 840 ticks: 10 µs.
fn at_100_khz() -> Tim {
    let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
    tim.put(0, [(ARR, 839), (EGR, 1), (SR, 0), (CR1, CEN)]);
    tim
}

#[test]
fn the_crystal_is_captured_by_the_timer_whose_input_it_can_be() {
    const OR: u32 = 0x50;
    let captures = |kind: TimerKind, crystal: (u32, u32)| {
        let mut tim = Tim::new(kind.on_apb2(), 16_000_000);
        tim.set_clocks(
            &ClockTree {
                crystal,
                ..ClockTree::HSI
            },
            0,
        );
        let has = tim.write(OR, BY_CRYSTAL, 0).is_ok();
        // Every eighth edge; on.
        tim.put(100, [(CCMR1, 0b1101), (CCER, 1), (CR1, CEN)]);
        let mut values = Vec::new();
        for at in (200..400_000).step_by(200) {
            if tim.get(SR, at) & 2 != 0 {
                values.push(tim.get(CCR1, at));
            }
        }
        assert_eq!(tim.get(SR, 400_000) & 1 << 9, 0, "each was read");
        tim.get(SR, 900_000);
        (has, values, tim.get(SR, 900_000) & 1 << 9 != 0)
    };
    for (mhz, ticks) in [(8, 496.0), (12, 330.7), (25, 158.7)] {
        let (has, values, over) = captures(TimerKind::WITH_CRYSTAL, (mhz * 1_000_000, 31));
        let last = f64::from(values[values.len() - 1] - values[0]) / (values.len() - 1) as f64;
        assert!((last - ticks).abs() < 0.2 && has && over, "{mhz} MHz: {last}");
    }
    assert_eq!(captures(TimerKind::WITH_CRYSTAL, (0, 0)), (true, vec![], false));
    assert_eq!(
        captures(TimerKind::ONE_CHANNEL, (8_000_000, 31)),
        (false, vec![], false)
    );
}

#[test]
fn the_update_flag_rises_at_the_period_and_a_zero_clears_it() {
    let mut tim = at_100_khz();
    assert_eq!([9_999, 10_000].map(|at| tim.get(SR, at) & 1), [0, 1]);
    tim.put(10_100, [(SR, !2)]);
    assert_eq!(tim.get(SR, 10_100) & 1, 1, "a 1 leaves the flag");
    tim.put(10_100, [(SR, !1)]);
    assert_eq!([19_999, 20_000].map(|at| tim.get(SR, at) & 1), [0, 1]);
}

#[test]
fn the_next_interrupt_is_known_before_it_comes_and_only_if_enabled() {
    let mut tim = at_100_khz();
    assert_eq!(tim.next_interrupt(), None);
    tim.put(3_000, [(DIER, 1)]);
    assert_eq!(tim.next_interrupt(), Some(10_000));
    tim.advance(10_000);
    assert!(tim.interrupt(0));
    assert_eq!(tim.next_interrupt(), None, "the line is up already");
}

#[test]
fn settings_say_when_the_next_interrupt_comes_and_the_one_after_it() {
    // A compare value beyond the period matches at the update. A count beyond it runs to its end first. A
    // preloaded period takes effect at the update, a direct one at once.
    for (cr1, writes, [first, second]) in [
        (CEN, [(CCR1, 84), (DIER, 2)], [1_000, 11_000]),
        (CEN, [(CCR1, 900), (DIER, 2)], [10_000, 20_000]),
        (CEN, [(CNT, 0xffff - 83), (DIER, 1)], [1_000, 11_000]),
        (CEN, [(ARR, 419), (DIER, 1)], [5_000, 10_000]),
        (CEN | ARPE, [(ARR, 419), (DIER, 1)], [10_000, 15_000]),
    ] {
        let mut tim = at_100_khz();
        tim.put(0, [(CR1, cr1)]);
        tim.put(0, writes);
        assert_eq!(tim.next_interrupt(), Some(first), "{writes:?}");
        tim.put(first, [(SR, 0)]);
        assert_eq!(tim.next_interrupt(), Some(second), "{writes:?}");
    }
}

#[test]
fn a_compare_moves_its_output_at_the_match_as_its_mode_says() {
    let mut tim = at_100_khz();
    let state = |tim: &Tim| (tim.output(0), tim.next_output());
    tim.put(0, [(CCR1, 84), (CCMR1, 0b101 << 4)]);
    assert_eq!(state(&tim), (None, None), "it is off");
    tim.put(0, [(CCER, 1)]);
    assert_eq!(state(&tim), (Some(true), None), "forced");
    // Inactive on match.
    tim.put(500, [(CCMR1, 0b010 << 4)]);
    assert_eq!(state(&tim), (Some(true), Some(1_000)));
    tim.advance(999);
    assert_eq!(tim.output(0), Some(true));
    tim.advance(1_000);
    assert_eq!(state(&tim), (Some(false), None));
    // Active on match, and inverted.
    tim.put(2_000, [(CCMR1, 0b001 << 4), (CCER, 0b11)]);
    assert_eq!(state(&tim), (Some(true), Some(11_000)));
    tim.advance(11_000);
    assert_eq!(tim.output(0), Some(false));
    // Toggle.
    tim.put(12_000, [(CCMR1, 0b011 << 4)]);
    for (at, level) in [(21_000, true), (31_000, false)] {
        assert_eq!(tim.next_output(), Some(at));
        tim.advance(at);
        assert_eq!(tim.output(0), Some(level));
    }
}

#[test]
fn ug_restarts_the_counter_loads_the_prescaler_and_flags_unless_urs() {
    let mut tim = at_100_khz();
    tim.put(4_000, [(PSC, 83)]);
    assert_eq!(tim.get(CNT, 5_000), 420, "the prescaler waits for an update");
    tim.put(5_000, [(EGR, 1)]);
    assert_eq!(tim.get(SR, 5_000) & 1, 1);
    assert_eq!(tim.get(CNT, 15_000), 10, "1 MHz from here");
    let mut tim = at_100_khz();
    tim.put(5_000, [(CR1, CEN | URS), (EGR, 1)]);
    assert_eq!(tim.get(SR, 5_000) & 1, 0);
}

#[test]
fn a_new_prescaler_takes_effect_at_the_update() {
    let mut tim = at_100_khz();
    tim.put(4_000, [(PSC, 1)]);
    assert_eq!([9_999, 20_000].map(|at| tim.get(CNT, at)), [839, 420]);
}

#[test]
fn a_preloaded_compare_value_waits_for_the_update() {
    let mut tim = at_100_khz();
    tim.put(2_000, [(CCMR1, 1 << 3), (CCR1, 84)]);
    assert_eq!(tim.get(SR, 9_999) & 2, 0, "still 0, which has not come");
    tim.put(10_000, [(SR, 0)]);
    assert_eq!([10_999, 11_000].map(|at| tim.get(SR, at) & 2), [0, 2]);
}

#[test]
fn the_trigger_output_follows_the_update_and_never_drifts() {
    // 84 MHz / 1000: a period of 11904.76 ns, which no sum of whole ns can follow.
    let mut tim = at_100_khz();
    tim.put(0, [(CR2, 0b010 << 4), (ARR, 999)]);
    let mut last = 0;
    for _ in 0..84_000 {
        last = tim.trigger(0).unwrap();
        tim.advance(last);
    }
    assert_eq!(last, 1_000_000_000);
    assert_eq!(tim.trigger(83_999), Some(2_000_000_000));
}

#[test]
fn udis_stops_updates_and_their_trigger() {
    let mut tim = at_100_khz();
    tim.put(0, [(CR2, 0b010 << 4), (CR1, CEN | UDIS)]);
    assert_eq!((tim.trigger(0), tim.get(SR, 50_000) & 1), (None, 0));
}

#[test]
fn a_slower_clock_keeps_the_count_and_stretches_what_is_left() {
    let mut tim = at_100_khz();
    tim.put(0, [(DIER, 1)]);
    let mut slower = ClockTree::HSI;
    slower.timers1 = 42_000_000;
    tim.set_clocks(&slower, 5_000);
    assert_eq!((tim.get(CNT, 5_000), tim.next_interrupt()), (420, Some(15_000)));
}

/// Channel 1 of a timer of 32 bits captures its own input, with these bits of CCER.
fn capturing(ccer: u32) -> Tim {
    let mut tim = Tim::new(TimerKind::GENERAL_32, 84_000_000);
    tim.put(0, [(CCMR1, 0b01), (CCER, ccer), (CR1, CEN)]);
    tim
}

#[test]
fn an_edge_latches_the_counter_and_reading_it_clears_the_flag() {
    let mut tim = capturing(1);
    tim.edge(0, true, 60_000_000_000);
    let now = 60_000_100_000;
    assert_eq!(tim.get(SR, now) & 2, 2);
    let expected = (60u64 * 84_000_000 - (1 << 32)) as u32;
    assert_eq!(tim.get(CCR1, now), expected, "of 32 bits");
    assert_eq!(tim.get(SR, now) & 2, 0);
    tim.put(now, [(CCR1, 5)]);
    assert_eq!(tim.get(CCR1, now), expected, "read-only");
}

#[test]
fn the_polarity_says_which_edges_count_and_a_channel_that_is_off_sees_none() {
    let seen = |ccer: u32| {
        [true, false].map(|rising| {
            let mut tim = capturing(ccer);
            tim.edge(0, rising, 1_000);
            tim.edge(1, rising, 1_000);
            tim.get(SR, 1_000) == 2
        })
    };
    assert_eq!(seen(0b0001), [true, false], "rising");
    assert_eq!(seen(0b0011), [false, true], "falling");
    assert_eq!(seen(0b1011), [true, true], "both");
    assert_eq!(seen(0b1010), [false, false], "CC1E is clear");
}

#[test]
fn a_channel_may_take_its_neighbours_input() {
    let mut tim = capturing(0);
    tim.put(0, [(CCMR1, 0b10 << 8), (CCER, 1 << 4)]);
    tim.edge(0, true, 1_000);
    assert_eq!((tim.get(SR, 1_000), tim.get(CCR1 + 4, 1_000)), (4, 84));
}

#[test]
fn a_second_edge_before_the_first_was_read_overwrites_it_and_is_told() {
    let mut tim = capturing(1);
    tim.edge(0, true, 1_000);
    tim.edge(0, true, 2_000);
    assert_eq!((tim.get(SR, 2_000), tim.get(CCR1, 2_000)), (2 | 1 << 9, 168));
    assert_eq!(tim.get(SR, 2_000), 1 << 9, "CC1OF is cleared by a write only");
    tim.put(2_000, [(SR, !(1 << 9))]);
    assert_eq!(tim.get(SR, 2_000), 0);
}

#[test]
fn a_capture_interrupts_if_enabled_and_an_input_never_compares() {
    let mut tim = capturing(1);
    assert!(!tim.edge_interrupts(0, true));
    tim.put(0, [(DIER, 2)]);
    // The counter passes CCR1, which is 0, unnoticed.
    assert_eq!(tim.next_interrupt(), None);
    assert!(tim.edge_interrupts(0, true) && !tim.edge_interrupts(0, false));
    tim.edge(0, true, 1_000);
    assert!(tim.interrupt(0));
    assert!(!tim.edge_interrupts(0, true), "the line is up already");
}

/// The edges of the first output: times in ns and levels.
fn edges(tim: &mut Tim, count: usize) -> Vec<(u64, Option<bool>)> {
    let next = |tim: &mut Tim| {
        let at = tim.next_output()?;
        tim.advance(at);
        Some((at, tim.output(0)))
    };
    (0..count).map_while(|_| next(tim)).collect()
}

/// 10 us, with a preloaded compare value.
fn modulated(mode: u32, compare: u32) -> Tim {
    let mut tim = at_100_khz();
    tim.put(
        0,
        [(CCR1, compare), (CCMR1, mode << 4 | 1 << 3), (EGR, 1), (CCER, 1)],
    );
    tim
}

#[test]
fn a_pwm_output_is_high_below_its_compare_value_or_above_it() {
    let (high, low) = (Some(true), Some(false));
    let mut one = modulated(0b110, 210);
    assert_eq!(one.output(0), high);
    assert_eq!(
        edges(&mut one, 4),
        [(2_500, low), (10_000, high), (12_500, low), (20_000, high)]
    );
    let mut two = modulated(0b111, 210);
    assert_eq!(
        (two.output(0), edges(&mut two, 2)),
        (low, vec![(2_500, high), (10_000, low)])
    );
    for (compare, level) in [(0, low), (840, high)] {
        let mut still = modulated(0b110, compare);
        assert_eq!((still.output(0), edges(&mut still, 1)), (level, vec![]));
    }
}

#[test]
fn a_preloaded_compare_value_counts_from_the_next_period_on() {
    let (high, low) = (Some(true), Some(false));
    let mut tim = modulated(0b110, 210);
    tim.put(1_000, [(CCR1, 420)]);
    assert_eq!(edges(&mut tim, 3), [(2_500, low), (10_000, high), (15_000, low)]);
    tim.put(16_000, [(CCR1, 0)]);
    // At the update it looks again, and stays low.
    assert_eq!(edges(&mut tim, 2), [(20_000, low)]);
}

#[test]
fn a_complementary_output_is_the_opposite_or_stands_alone_and_needs_moe() {
    let mut tim = Tim::new(TimerKind::ADVANCED, 84_000_000);
    tim.put(0, [(CCMR1, 0b101 << 4), (CCER, 0b101)]);
    assert_eq!((tim.output(0), tim.complement(0)), (None, None));
    tim.put(0, [(0x44, MOE)]);
    assert_eq!((tim.output(0), tim.complement(0)), (Some(true), Some(false)));
    tim.put(0, [(CCER, 0b100)]);
    assert_eq!((tim.output(0), tim.complement(0)), (None, Some(true)));
    tim.put(0, [(CCER, 0b1100)]);
    assert_eq!(tim.complement(0), Some(false), "CC1NP");
}

#[test]
fn an_update_turns_the_main_output_on_if_aoe_is_set() {
    let start = |cr1: u32| {
        let mut tim = Tim::new(TimerKind::ADVANCED, 84_000_000);
        let pwm = [(CCMR1, 0b110 << 4), (CCER, 1), (ARR, 839), (CCR1, 210)];
        tim.put(0, pwm);
        tim.put(0, [(0x44, AOE), (CR1, CEN | cr1)]);
        tim
    };
    let mut tim = start(0);
    assert_eq!((tim.output(0), tim.next_output()), (None, Some(10_000)));
    tim.advance(10_000);
    assert_eq!((tim.output(0), tim.get(0x44, 10_000)), (Some(true), AOE | MOE));
    assert_eq!(edges(&mut tim, 2), [(12_500, Some(false)), (20_000, Some(true))]);
    let mut tim = start(0);
    tim.put(1_000, [(0x14, UPDATE)]);
    assert_eq!(tim.output(0), Some(true), "UG");
    let mut tim = start(UDIS);
    tim.advance(30_000);
    assert_eq!(
        (tim.output(0), tim.next_output()),
        (None, None),
        "without updates"
    );
}

/// PWM input (section 18.3.7): TI1 restarts the counter, and both its edges are captured.
#[test]
fn a_timer_restarted_by_its_input_measures_period_and_width() {
    let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
    tim.put(
        0,
        [
            (CCMR1, 0b10 << 8 | 0b01),
            (CCER, 0b0011_0001),
            (SMCR, 0b101 << 4 | RESTARTS),
            (CR1, CEN),
        ],
    );
    for (at, rising) in [(5_000, true), (8_000, false), (15_000, true), (18_000, false)] {
        tim.edge(0, rising, at);
    }
    assert_eq!((tim.get(CCR1, 18_000), tim.get(CCR1 + 4, 18_000)), (840, 252));
    assert_eq!(tim.get(CNT, 20_000), 420, "since 15 us");
    assert_eq!(tim.get(SR, 20_000) & TRIGGER, TRIGGER);
    assert_eq!(tim.notes.iter().count(), 0);
}

#[test]
fn updates_matches_and_captures_ask_the_dma_until_they_are_served() {
    let mut tim = at_100_khz();
    tim.put(0, [(CCR1, 210), (DIER, 0b11 << 8)]);
    assert_eq!(tim.next_request(), Some(2_500));
    tim.advance(2_500);
    assert_eq!((tim.requests(), tim.next_request()), (2, Some(10_000)));
    tim.advance(10_000);
    assert_eq!(tim.requests(), 3);
    tim.served(2);
    assert_eq!(tim.requests(), 1);
    let mut tim = capturing(1);
    tim.edge(0, true, 1_000);
    assert_eq!(tim.requests(), 0);
    tim.put(0, [(DIER, 2 << 8)]);
    assert!(tim.edge_interrupts(0, true), "a stream may interrupt");
    tim.edge(0, true, 2_000);
    assert_eq!(tim.requests(), 2);
}

#[test]
fn a_timer_in_trigger_mode_starts_with_its_master_and_only_then() {
    let mut tim2 = Tim::new(TimerKind::GENERAL_32, 84_000_000);
    assert_eq!(tim2.waits_for(), None);
    tim2.put(0, [(SMCR, 0b010 << 4 | 0b110)]);
    assert_eq!((tim2.waits_for(), tim2.get(CNT, 5_000)), (Some(2), 0), "ITR2");
    tim2.start(10_000);
    assert_eq!((tim2.waits_for(), tim2.get(SR, 10_000)), (None, TRIGGER));
    assert_eq!(tim2.get(CNT, 20_000), 840);
    assert_eq!(tim2.notes.iter().count(), 0);
}

#[test]
fn what_is_not_modelled_is_noted() {
    let mut tim = at_100_khz();
    tim.put(0, [(SMCR, 5), (CR1, CEN | 1 << 4)]);
    assert_eq!(tim.notes.iter().count(), 2);
    assert_eq!(tim.write(0x48, 0, 0), Err(NoRegister));
    let mut pwm = Tim::new(TimerKind::ADVANCED, 84_000_000);
    pwm.put(0, [(CCMR1, 0b110 << 4), (CCER, 0b101)]);
    assert_eq!(pwm.notes.iter().count(), 0);
    pwm.put(0, [(0x44, 10)]);
    assert_eq!(pwm.notes.iter().collect::<Vec<_>>(), [DEAD_TIME]);
}

/// A turn forwards: TI1 leads. Each edge of both inputs counts in mode 3, of one in modes 1 and 2.
#[test]
fn an_encoder_counts_up_and_down_over_the_ends_of_its_period() {
    const FORWARDS: [(usize, bool, bool); 4] = [
        (0, true, false),
        (1, true, true),
        (0, false, true),
        (1, false, false),
    ];
    for (mode, counts) in [(0b001, 2), (0b010, 2), (0b011, 4)] {
        let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
        tim.put(0, [(ARR, 3), (SMCR, mode), (CR1, CEN)]);
        let mut turn = |edges: &[(usize, bool, bool)], at: u64| {
            for (input, rising, other) in edges {
                tim.edge(*input, *rising, at);
                tim.encode(*input, *rising, *other, at);
            }
            let state = (tim.get(CNT, at), tim.get(CR1, at) >> 4 & 1, tim.get(SR, at) & 1);
            tim.put(at, [(SR, 0)]);
            state
        };
        assert_eq!(turn(&FORWARDS, 1_000), (counts % 4, 0, counts / 4), "up");
        let backwards = [
            (1, true, false),
            (0, true, true),
            (1, false, true),
            (0, false, false),
        ];
        assert_eq!(
            turn(&backwards, 2_000),
            (0, 1, counts / 4),
            "and down to where it was"
        );
        assert_eq!(turn(&backwards[..2], 3_000), (4 - counts / 2, 1, 1), "below zero");
        assert_eq!(tim.notes.iter().count(), 0);
    }
}

#[test]
fn an_input_that_is_inverted_turns_an_encoder_round() {
    let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
    tim.put(0, [(ARR, 0xffff), (CCER, 0b10), (SMCR, 0b011), (CR1, CEN)]);
    tim.encode(0, true, false, 1_000);
    assert_eq!((tim.get(CNT, 1_000), tim.get(CR1, 1_000)), (0xffff, CEN | DIR));
}

#[test]
fn edges_of_an_input_are_counted_by_the_prescaler_and_interrupt_at_the_end() {
    let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
    tim.put(0, [(0x28, 1), (ARR, 2), (0x14, 1), (SR, 0), (DIER, 1)]);
    tim.put(0, [(SMCR, 0b101 << 4 | COUNTS_EDGES), (CR1, CEN)]);
    assert!(tim.captures_interrupt() && tim.edge_interrupts(0, true));
    for n in 1..=6 {
        assert_eq!(tim.get(SR, n) & UPDATE, 0);
        tim.edge(0, true, n);
        tim.edge(0, false, n);
    }
    assert_eq!(
        (tim.get(CNT, 1_000_000), tim.get(SR, 7) & UPDATE),
        (0, UPDATE),
        "after 2 · 3 edges"
    );
    // Back to the timer's own clock.
    tim.put(1_000_000, [(SMCR, 0)]);
    assert_eq!(tim.get(CNT, 1_000_024), 1, "84 MHz by two");
    assert_eq!(tim.notes.iter().count(), 0);
}
