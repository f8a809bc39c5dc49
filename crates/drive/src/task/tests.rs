use drivebus_drives::Command;

use super::*;

const UNIT: u8 = 5;

fn read() -> Read {
    Read::word(UnitAddress::by_name(UNIT), 0x2100.into())
}

fn at(nanos: u64) -> Seen {
    Seen { now: Instant::from_nanos(nanos), connection: 0, is_closed: false }
}

/// Reads until it hears 3, and waits a second between two reads.
fn until_three() -> Task<Result<Instant, &'static str>, &'static str> {
    Task::new(async |line: Mailbox<_>| {
        while line.read(read()).await? != [3] {
            line.sleep(Duration::from_secs(1)).await?;
        }
        Ok(line.now())
    })
}

fn wish(step: Result<Step<Result<Instant, &'static str>>, Misuse>) -> Wish {
    match step {
        Ok(Step::Wish(wish)) => wish,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_operation_goes_on_with_what_it_is_brought() {
    let mut task = until_three();
    assert!(task.pending().is_none());
    assert_eq!(wish(task.step(at(0), None)), Wish::Read(read()));
    assert_eq!(wish(task.step(at(5), Some(Outcome::Words(vec![1])))), Wish::Sleep(Duration::from_secs(1)));
    assert_eq!(wish(task.step(at(6), Some(Outcome::Slept))), Wish::Read(read()));
    assert_eq!(task.pending(), Some(&Wish::Read(read())));
    let done = task.step(at(9), Some(Outcome::Words(vec![3])));
    assert!(matches!(done, Ok(Step::Done(Ok(now))) if now == Instant::from_nanos(9)), "{done:?}");
    assert!(task.pending().is_none());
    assert_eq!(task.step(at(9), None).unwrap_err(), Misuse::Over);
}

#[test]
fn an_error_ends_what_does_not_handle_it() {
    let mut task = until_three();
    wish(task.step(at(0), None));
    let done = task.step(at(0), Some(Outcome::Failed("the cable is off")));
    assert!(matches!(done, Ok(Step::Done(Err("the cable is off")))), "{done:?}");
}

/// What is no outcome of the last wish is refused, and the task can be given the right one then.
#[test]
fn a_misuse_changes_nothing() {
    let mut task = until_three();
    assert_eq!(task.step(at(7), Some(Outcome::Slept)).unwrap_err(), Misuse::NotWished);
    wish(task.step(at(7), None));
    assert_eq!(task.step(at(7), None).unwrap_err(), Misuse::NoOutcome(Wish::Read(read())));
    for unfit in [Outcome::Slept, Outcome::Words(vec![]), Outcome::Words(vec![3, 3])] {
        assert_eq!(task.step(at(7), Some(unfit)).unwrap_err(), Misuse::Unfit(Wish::Read(read())));
    }
    let early = task.step(at(6), Some(Outcome::Words(vec![3]))).unwrap_err();
    assert_eq!(early, Misuse::WentBack(Duration::from_nanos(1)));
    assert_eq!(task.pending(), Some(&Wish::Read(read())));
    assert!(matches!(task.step(at(7), Some(Outcome::Words(vec![3]))), Ok(Step::Done(Ok(_)))));
}

#[test]
fn an_operation_sees_the_line_as_it_is_at_each_step() {
    let mut task: Task<_, &str> = Task::new(async |line: Mailbox<_>| {
        let before = (line.connection(), line.is_closed());
        line.sleep(Duration::ZERO).await.unwrap();
        (before, (line.connection(), line.is_closed()))
    });
    assert!(matches!(task.step(Seen { connection: 3, ..at(0) }, None), Ok(Step::Wish(_))));
    let lost = Seen { connection: 4, is_closed: true, ..at(1) };
    let Ok(Step::Done(seen)) = task.step(lost, Some(Outcome::Slept)) else { panic!() };
    assert_eq!(seen, ((3, false), (4, true)));
}

#[test]
fn a_wish_says_of_whom_it_is_and_as_what_that_is_taken() {
    let families = crate::families::Families::shipped();
    let named = |name| families.named(name).unwrap();
    let mut task: Task<_, &str> = Task::new(|line: Mailbox<_>| async move {
        line.taken_for(UnitAddress::by_name(1), named("gd350")).tell(Notice::Took(Command::Stop)).await;
        line.taken_for(UnitAddress::by_name(2), named("vfd500")).tell(Notice::Took(Command::Stop)).await;
        line.sleep(Duration::ZERO).await
    });
    let mut outcome = None;
    for expected in [Some((1, "gd350")), Some((2, "vfd500")), None] {
        assert!(matches!(task.step(at(0), outcome), Ok(Step::Wish(_))));
        assert_eq!(task.taken_for().map(|(unit, family)| (unit.get(), family.name())), expected);
        outcome = Some(Outcome::Heard);
    }
    assert!(matches!(task.step(at(0), Some(Outcome::Slept)), Ok(Step::Done(Ok(())))));
    assert_eq!(task.taken_for().map(|(unit, _)| unit), None);
}

#[test]
fn what_waits_for_something_else_is_told_so() {
    let mut task: Task<(), &str> = Task::new(async |_| std::future::pending().await);
    assert_eq!(task.step(at(0), None).unwrap_err(), Misuse::Stuck);
    assert!(task.pending().is_none());
}
