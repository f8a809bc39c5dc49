//! Who comes next, on paper: priorities, units that take turns, and who was overtaken long enough.

mod linear;

use std::cell::Cell;

use proptest::prelude::*;

use super::*;
use linear::Linear;

use Priority::{Poll, Read, Stop, Write};

fn unit(raw: u8) -> Option<UnitAddress> {
    UnitAddress::new(raw).ok()
}

/// Comes and waits; what is kept about it is its name.
fn come(order: &mut Order<u32>, priority: Priority, raw: u8, name: u32) -> Ticket {
    let ticket = order.ticket((priority, unit(raw)).into());
    order.wait(ticket, name);
    ticket
}

/// Gives the next one its turn.
fn serve(order: &mut Order<u32>) -> u32 {
    let ticket = order.next_ticket().unwrap();
    order.take(ticket).unwrap()
}

fn serve_all(order: &mut Order<u32>) -> Vec<u32> {
    (0..order.len()).map(|_| serve(order)).collect()
}

#[test]
fn stops_come_first_then_writes_reads_and_polling() {
    let mut order = Order::default();
    for (name, priority) in (0..).zip([Poll, Read, Write, Stop, Poll, Read, Write, Stop]) {
        come(&mut order, priority, 1, name);
    }
    assert_eq!(order.next_ticket().map(|ticket| ticket.is_stop()), Some(true));
    assert_eq!(serve_all(&mut order), [3, 7, 2, 6, 1, 5, 0, 4]);
}

#[test]
fn only_the_next_one_can_take_the_turn() {
    let mut order = Order::default();
    let read = come(&mut order, Read, 1, 1);
    let write = come(&mut order, Write, 1, 2);
    assert_eq!(order.take(read), None);
    assert_eq!(order.take(write), Some(2));
    assert_eq!(order.take(write), None);
    assert_eq!(order.take(read), Some(1));
    assert_eq!(order.next(), None);
}

#[test]
fn units_take_turns_however_many_ask_for_one_of_them() {
    let mut order = Order::default();
    for (name, raw) in [(10, 1), (11, 1), (12, 1), (13, 1), (20, 2), (21, 2), (30, 3), (0, 0), (1, 0)] {
        come(&mut order, Read, raw, name);
    }
    assert_eq!(serve_all(&mut order), [10, 20, 30, 0, 11, 21, 1, 12, 13]);
    // Unit 3 waited longest for its last turn, though it asks last now.
    for (name, raw) in [(14, 1), (22, 2), (31, 3)] {
        come(&mut order, Read, raw, name);
    }
    assert_eq!(serve_all(&mut order), [31, 22, 14]);
}

#[test]
fn stops_and_writes_take_nothing_from_the_reads_of_their_unit() {
    let mut order = Order::default();
    come(&mut order, Read, 2, 20);
    serve_all(&mut order);
    for name in 0..3 {
        come(&mut order, Stop, 1, name);
        come(&mut order, Write, 1, name);
    }
    serve_all(&mut order);
    come(&mut order, Read, 2, 21);
    come(&mut order, Read, 1, 10);
    assert_eq!(serve_all(&mut order), [10, 21]);
}

#[test]
fn who_was_overtaken_thirty_two_times_is_next() {
    let mut order = Order::default();
    come(&mut order, Poll, 1, 1);
    come(&mut order, Read, 2, 2);
    for turn in 0..100 {
        come(&mut order, Write, 3, 1000 + turn);
        // The one that came first after 32 turns, the other after 32 more.
        let expected = match turn {
            32 => 1,
            65 => 2,
            turn => 1000 + turn - u32::from(turn > 32) - u32::from(turn > 65),
        };
        assert_eq!(serve(&mut order), expected, "turn {turn}");
    }
}

#[test]
fn who_is_dismissed_waits_no_longer() {
    let mut order = Order::default();
    for name in 0..6 {
        come(&mut order, Read, 1, name);
        assert_eq!(order.len(), order.waiting().count());
    }
    assert_eq!((order.len(), order.waiting().copied().collect()), (6, vec![0, 1, 2, 3, 4, 5]));
    assert_eq!(order.dismiss(|name| name % 2 == 0), [0, 2, 4]);
    assert_eq!((order.len(), order.next()), (3, Some(&1)));
    assert_eq!(serve_all(&mut order), [1, 3, 5]);
    assert_eq!(order.next_ticket(), None);
}

#[test]
fn a_stop_is_never_held_back() {
    let mut order = Order::default();
    come(&mut order, Read, 1, 99);
    for name in 0..100 {
        come(&mut order, Stop, 2, name);
        assert_eq!(serve(&mut order), name);
    }
    // Nor do stops count as overtaking: a write still goes first.
    come(&mut order, Write, 2, 100);
    assert_eq!(serve_all(&mut order), [100, 99]);
}

#[test]
fn who_steps_aside_stays_ahead_of_all_but_stops() {
    let mut order = Order::default();
    let poll = come(&mut order, Poll, 1, 1);
    assert_eq!(order.take(poll), Some(1));
    come(&mut order, Write, 2, 2);
    come(&mut order, Stop, 3, 3);
    assert!(order.has_stop());
    order.step_aside(poll, 1);
    come(&mut order, Stop, 4, 4);
    assert_eq!(serve_all(&mut order), [3, 4, 1, 2]);
    assert!(!order.has_stop());
}

/// One of the callers of the model.
#[derive(Debug, Clone)]
struct Caller {
    arrival: usize,
    class: u8,
    unit: u8,
    overtaken: u32,
}

/// The rule as a sort over the whole history: `past` holds the class and unit of every turn there was.
fn sorted(callers: &mut [Caller], past: &[(u8, u8)]) {
    callers.sort_by_key(|caller| {
        let kin = (caller.class, caller.unit);
        let last_turn = past.iter().rposition(|&turn| turn == kin).map_or(0, |index| index + 1);
        let late = caller.overtaken >= 32;
        match caller.class {
            0 => (0, 0, 0, caller.arrival),
            _ if late => (1, 0, 0, caller.arrival),
            class => (2, class, last_turn, caller.arrival),
        }
    });
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Come { class: u8, unit: u8 },
    Serve,
    Leave(prop::sample::Index),
}

/// Some steps in any order, or a rush of writes that overtake whoever waits.
fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        3 => (0u8..4, 0u8..4).prop_map(|(class, unit)| Step::Come { class, unit }),
        2 => Just(Step::Serve),
        1 => any::<prop::sample::Index>().prop_map(Step::Leave),
    ];
    let rush =
        (10usize..40, 0u8..4).prop_map(|(count, unit)| [Step::Come { class: 1, unit }, Step::Serve].repeat(count));
    prop_oneof![prop::collection::vec(step, 1..12), rush]
}

proptest! {
    #[test]
    fn the_order_is_that_of_the_model(steps in prop::collection::vec(steps(), 0..20)) {
        let mut order = Order::default();
        let mut callers: Vec<Caller> = Vec::new();
        let mut past = Vec::new();
        let mut tickets = Vec::new();
        for step in steps.into_iter().flatten() {
            match step {
                Step::Come { class, unit: raw } => {
                    let arrival = tickets.len();
                    let priority = [Stop, Write, Read, Poll][usize::from(class)];
                    tickets.push(come(&mut order, priority, raw, u32::try_from(arrival).unwrap()));
                    callers.push(Caller { arrival, class, unit: raw, overtaken: 0 });
                }
                Step::Leave(index) if !callers.is_empty() => {
                    let gone = callers.remove(index.index(callers.len()));
                    order.leave(tickets[gone.arrival]);
                }
                Step::Serve if !callers.is_empty() => {
                    sorted(&mut callers, &past);
                    let first = callers.remove(0);
                    past.push((first.class, first.unit));
                    for other in &mut callers {
                        if first.overtaken >= 32 && other.arrival > first.arrival {
                            other.overtaken = 0;
                        } else if (1..other.class).contains(&first.class) && first.arrival > other.arrival {
                            other.overtaken += 1;
                        }
                    }
                    prop_assert_eq!(serve(&mut order), u32::try_from(first.arrival).unwrap());
                }
                Step::Leave(_) | Step::Serve => {}
            }
            prop_assert_eq!(order.is_empty(), callers.is_empty());
        }
    }

    /// Whatever comes later, who waits is served after at most 32 overtaking turns for itself and each who was there.
    #[test]
    fn nobody_starves(
        before in prop::collection::vec((0u8..4, 0u8..4), 0..6),
        class in 1u8..4,
        later in prop::collection::vec((1u8..4, 0u8..4), 600),
    ) {
        let priorities = [Stop, Write, Read, Poll];
        let mut order = Order::default();
        for &(class, raw) in &before {
            come(&mut order, priorities[usize::from(class)], raw, 0);
        }
        come(&mut order, priorities[usize::from(class)], 1, 1);
        let mut overtaken = 0;
        let mut served = false;
        for (other, raw) in later {
            let name = 2 + u32::from(other);
            come(&mut order, priorities[usize::from(other)], raw, name);
            match serve(&mut order) {
                1 => {
                    served = true;
                    break;
                }
                name if name >= 2 && name - 2 < u32::from(class) => overtaken += 1,
                _ => {}
            }
        }
        prop_assert!(served);
        prop_assert!(overtaken <= 32 * (before.len() + 1), "overtaken {} times", overtaken);
    }
}

#[test]
fn programs_take_turns_however_many_units_one_of_them_asks() {
    let mut order = Order::default();
    let mut come = |program: u16, raw: u8, name: u32| {
        let claim = Claim { priority: Read, unit: unit(raw), program: Program(program) };
        let ticket = order.ticket(claim);
        order.wait(ticket, name);
    };
    for raw in 1..=4 {
        come(0, raw, raw.into());
    }
    for name in [11, 12, 13] {
        come(1, 1, name);
    }
    come(2, 9, 21);
    assert_eq!(serve_all(&mut order), [1, 21, 11, 2, 12, 3, 13, 4]);
}

#[test]
fn a_stop_of_any_program_goes_first_and_a_write_before_its_reads() {
    let mut order = Order::default();
    for (name, priority, program) in [(0, Read, 0), (1, Poll, 1), (2, Write, 2), (3, Stop, 3), (4, Stop, 0)] {
        let ticket = order.ticket(Claim { priority, unit: unit(1), program: Program(program) });
        order.wait(ticket, name);
    }
    assert_eq!(serve_all(&mut order), [3, 4, 2, 0, 1]);
}

thread_local! {
    static COMPARISONS: Cell<u64> = const { Cell::new(0) };
}

/// Two places were compared.
pub(super) fn compares() {
    COMPARISONS.set(COMPARISONS.get() + 1);
}

/// How many comparisons `what` takes.
fn comparisons(what: impl FnOnce()) -> u64 {
    let before = COMPARISONS.get();
    what();
    COMPARISONS.get() - before
}

fn claim(class: usize, raw: u8, program: u16) -> Claim {
    Claim { priority: [Stop, Write, Read, Poll][class], unit: unit(raw), program: Program(program) }
}

/// The most comparisons that a turn takes, that somebody comes, and that somebody leaves, while `count` wait: of `units` units
/// and `programs` programs, in all classes.
fn costs(count: u32, units: u32, programs: u32) -> [u64; 3] {
    let mut order = Order::default();
    let come = |order: &mut Order<u32>, name: u32| {
        let (raw, program) = (u8::try_from(name % units).unwrap(), u16::try_from(name % programs).unwrap());
        let ticket = order.ticket(claim(1 + (name / 7 % 3) as usize, raw, program));
        order.wait(ticket, name);
        ticket
    };
    (0..count).for_each(|name| _ = come(&mut order, name));
    let mut most = [0; 3];
    for name in count..count + 1_000 {
        let turn = comparisons(|| _ = serve(&mut order));
        let mut newest = None;
        let comes = comparisons(|| newest = Some(come(&mut order, name)));
        let leaves = comparisons(|| _ = order.leave(newest.unwrap()));
        come(&mut order, name);
        most = [most[0].max(turn), most[1].max(comes), most[2].max(leaves)];
    }
    most
}

/// A tree of a thousand times as many is ten comparisons deeper, and some trees are looked into for each.
#[test]
fn a_turn_costs_the_logarithm_of_what_waits() {
    for (units, programs) in [(1, 1), (247, 1), (5, 3)] {
        let (few, many) = (costs(16, units, programs), costs(16_000, units, programs));
        for (few, many) in few.into_iter().zip(many) {
            assert!(many <= few + 400, "{many} comparisons of 16 000, {few} of 16: {units} units, {programs} programs");
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Move {
    Come { class: usize, unit: u8, program: u16 },
    Serve,
    LetPass,
    Leave(prop::sample::Index),
    Dismiss(u32),
}

fn moves() -> impl Strategy<Value = Vec<Move>> {
    let come = |classes: std::ops::Range<usize>| {
        (classes, 0u8..5, 0u16..4).prop_map(|(class, unit, program)| Move::Come { class, unit, program })
    };
    let each = prop_oneof![
        60 => come(0..4),
        50 => Just(Move::Serve),
        4 => Just(Move::LetPass),
        8 => any::<prop::sample::Index>().prop_map(Move::Leave),
        1 => (2u32..9).prop_map(Move::Dismiss),
    ];
    let rush = (10usize..50, come(1..3)).prop_map(|(count, come)| [come, Move::Serve].repeat(count));
    prop_oneof![3 => prop::collection::vec(each, 1..60), 1 => prop::collection::vec(come(2..4), 1..40), 2 => rush]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn what_is_kept_sorted_is_in_the_order_of_who_looks_at_all(moves in prop::collection::vec(moves(), 0..12)) {
        let (mut order, mut linear) = (Order::default(), Linear::default());
        let mut tickets = Vec::new();
        for (name, step) in (0..).zip(moves.into_iter().flatten()) {
            match step {
                Move::Come { class, unit, program } => {
                    let ticket = order.ticket(claim(class, unit, program));
                    linear.knows(ticket.claim);
                    if order.is_empty() && name % 3 == 0 {
                        order.begin(ticket);
                        linear.begin(ticket);
                    } else {
                        order.wait(ticket, name);
                        linear.wait(ticket, name);
                        tickets.push(ticket);
                    }
                }
                Move::Serve => if let Some(ticket) = linear.next_ticket() {
                    prop_assert_eq!(order.take(ticket), linear.take(ticket));
                },
                Move::LetPass => if let Some(ticket) = linear.next_ticket().filter(|ticket| !ticket.is_stop()) {
                    prop_assert_eq!(order.take(ticket), linear.take(ticket));
                    order.step_aside(ticket, name);
                    linear.step_aside(ticket, name);
                },
                Move::Leave(index) => if !tickets.is_empty() {
                    let ticket = tickets[index.index(tickets.len())];
                    prop_assert_eq!(order.leave(ticket), linear.leave(ticket));
                },
                Move::Dismiss(each) => {
                    let mut gone = linear.dismiss(|name| name % each == 0);
                    gone.sort_unstable();
                    let mut left = order.dismiss(|name| name % each == 0);
                    left.sort_unstable();
                    prop_assert_eq!(left, gone);
                }
            }
            prop_assert_eq!(order.next_ticket(), linear.next_ticket());
            prop_assert_eq!((order.len(), order.is_empty(), order.has_stop()), (linear.len(), linear.is_empty(), linear.has_stop()));
        }
        while let Some(ticket) = linear.next_ticket() {
            prop_assert_eq!(order.take(ticket), linear.take(ticket));
        }
        prop_assert!(order.is_empty());
    }
}
