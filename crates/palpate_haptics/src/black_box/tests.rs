//! The ring buffer and its copies.

use super::*;

fn push(source: &mut BlackBox, ticks: u64) {
    for _ in 0..ticks {
        let sequence = source.newest + 1;
        source.push(BlackBoxTick { sequence, ..BlackBoxTick::default() });
    }
}

fn filled(ticks: u64) -> BlackBox {
    let mut source = BlackBox::new();
    push(&mut source, ticks);
    source
}

fn sequences(black_box: &BlackBox) -> Vec<u64> {
    black_box.ticks().map(|tick| tick.sequence).collect()
}

#[test]
fn keeps_newest_4096_ticks_in_order() {
    assert_eq!(filled(0).newest(), None);
    assert!(sequences(&filled(0)).is_empty());
    assert_eq!(sequences(&filled(3)), [1, 2, 3]);
    for ticks in [4095, 4096, 4097, 10_000] {
        let black_box = filled(ticks);
        let oldest = ticks.saturating_sub(4096) + 1;
        assert_eq!(sequences(&black_box), (oldest..=ticks).collect::<Vec<_>>());
        assert_eq!(black_box.newest().unwrap().sequence, ticks);
        assert_eq!(black_box.ticks().next_back(), black_box.newest());
    }
}

#[test]
fn frequently_updated_copy_is_always_complete() {
    let (mut source, mut copy) = (BlackBox::new(), BlackBox::new());
    copy.catch_up_with(&source);
    for ticks in (0..200).map(|i| i * 7 % 256) {
        push(&mut source, ticks);
        copy.catch_up_with(&source);
        assert_eq!(sequences(&copy), sequences(&source));
    }
}

#[test]
fn copy_gets_newest_ticks_first_after_long_pause() {
    for ticks in [257, 600, 4000, 4096, 9000] {
        let (mut source, mut copy) = (filled(100), BlackBox::new());
        copy.catch_up_with(&source);
        push(&mut source, ticks);
        copy.catch_up_with(&source);
        let newest: Vec<u64> = (source.newest - 255..=source.newest).collect();
        assert!(sequences(&copy).ends_with(&newest));
        for _ in 0..16 {
            push(&mut source, 1);
            copy.catch_up_with(&source);
            assert_eq!(copy.newest(), source.newest());
        }
        assert_eq!(sequences(&copy), sequences(&source), "{ticks}");
    }
}

#[test]
fn consecutive_pauses_leave_no_hole() {
    let (mut source, mut copy) = (BlackBox::new(), BlackBox::new());
    for ticks in [900, 3, 1500, 1, 700, 256, 4096, 300, 0] {
        push(&mut source, ticks);
        copy.catch_up_with(&source);
        let copied = sequences(&copy);
        assert!(copied.is_sorted() && copied.iter().all(|s| source.newest - s < 4096));
    }
    for _ in 0..20 {
        push(&mut source, 1);
        copy.catch_up_with(&source);
    }
    assert_eq!(sequences(&copy), sequences(&source));
}

#[test]
fn handles_largest_tick_number() {
    let mut source = filled(5);
    source.newest = u64::MAX - 1;
    source.push(BlackBoxTick::default());
    source.push(BlackBoxTick::default());
    let mut copy = filled(2);
    copy.catch_up_with(&source);
    copy.catch_up_with(&source);
    assert!(copy.ticks().count() <= 2);
}
