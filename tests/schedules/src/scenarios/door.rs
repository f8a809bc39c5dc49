//! Programs that come in through the door of a bus: each is answered or told, whoever of them goes, and whenever the bus ends.

use std::sync::Arc;

use drivebus_rtu::{Duration, Instant, Request, SerialFormat, UnitAddress};
use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::mpsc::channel;
use shuttle::thread;

use super::bus::{Sent, call, open, sent_by, wait_for};
use super::join;
use crate::bus::{Bus, OpenDoor};
use crate::options::CallOptions;
use crate::share::channel::Channel;
use crate::share::message::{Characters, GREETING, Hello, LET_IN, Order, Told, VERSION, Wish};
use crate::share::place::{Door, Entrance};
use crate::system::clock;
use crate::system::process::Life;
use crate::system::sockets::Listener;
use crate::turns::order::Priority;

/// A bus with a door.
struct House {
    bus: Arc<Bus>,
    sent: Sent,
    door: OpenDoor,
    entrances: Arc<[Entrance]>,
}

impl House {
    fn open() -> Self {
        Self::with(Listener::default())
    }

    fn with(listener: Listener) -> Self {
        let (bus, sent) = open();
        let door = Door::new(listener);
        let entrances = Arc::clone(&door.entrances);
        #[expect(clippy::unwrap_used, reason = "a scenario is a test")]
        let door = OpenDoor::new(door, &bus).unwrap();
        Self { bus, sent, door, entrances }
    }

    /// A program with this number, and what it does inside.
    fn program(&self, number: u16, does: impl FnOnce(Guest) + Send + 'static) -> thread::JoinHandle<()> {
        let entrances = Arc::clone(&self.entrances);
        thread::spawn(move || {
            let stream = entrances[0].listener.connect(number.into());
            // Who knocks has nothing of who listens.
            drop(entrances);
            let Ok(channel) = Channel::new(stream, usize::MAX, Arc::new(Life::Unknown)) else { return };
            does(Guest { channel, number });
        })
    }

    /// As a bus is closed that has a door.
    fn close(self) {
        self.bus.close();
        self.door.end();
    }
}

/// A program at the door, or inside.
struct Guest {
    channel: Channel,
    /// Which is the address that it writes to, too.
    number: u16,
}

impl Guest {
    fn comes_in(&mut self) -> bool {
        let characters = Characters::of(&SerialFormat::DEFAULT);
        let hello = Hello { program: String::from("guest"), characters, is_for_a_stop: false };
        let Ok(hello) = postcard::to_extend(&hello, [GREETING, &[VERSION]].concat()) else { return false };
        let _ = self.channel.say_bytes(&hello);
        matches!(self.channel.hear_bytes(far()), Ok(Some(welcome)) if welcome.first() == Some(&LET_IN))
    }

    fn asks(&mut self, priority: Priority) -> bool {
        let request = Request::write(self.number, 1);
        let ask = crate::ask::Ask {
            destination: UnitAddress::MIN.into(),
            request: &request,
            timeout: Duration::from_millis(100),
            learns: false,
            gap: Duration::ZERO,
            in_doubt: false,
            yields: None,
            meanings: None,
        };
        self.channel.say(&Wish::Call(Order::new(&ask, priority, 0, &CallOptions::default()))).is_ok()
    }

    /// What it is told in the end; `None` where the connection ended.
    fn hears(&mut self) -> Option<Told> {
        loop {
            match self.channel.hear(far()) {
                Ok(Some(Told::Waiting)) => {}
                Ok(told) => return told,
                Err(_) => return None,
            }
        }
    }

    fn is_answered(&mut self, priority: Priority) -> bool {
        self.asks(priority) && matches!(self.hears(), Some(Told::Answer { .. }))
    }
}

/// As long as it takes.
fn far() -> Instant {
    clock::monotonic() + Duration::from_secs(3_600)
}

fn sorted(sent: &Sent) -> Vec<u16> {
    let mut sent = sent_by(sent);
    sent.sort_unstable();
    sent
}

/// Two programs and this one: each asks once and is answered, and the door ends when the bus does.
pub(super) fn programs_come_in() {
    let house = House::open();
    let programs = [1, 2].map(|number| {
        house.program(number, |mut guest| assert!(guest.comes_in() && guest.is_answered(Priority::Write)))
    });
    assert_eq!(call(&house.bus, 9, Priority::Read, &mut || false), Ok(()));
    join(programs);
    assert_eq!(sorted(&house.sent), [1, 2, 9]);
    assert_eq!(house.door.answered(), 2);
    house.close();
}

/// A stop of another program that waits when the line comes free has it next.
pub(super) fn a_stop_of_another_program_is_next() {
    let house = House::open();
    let turn = house.bus.queue().turn((Priority::Read, None), &mut || false);
    assert!(turn.is_ok(), "it is free");
    let programs = [(1, Priority::Write), (2, Priority::Stop)].map(|(number, priority)| {
        house.program(number, move |mut guest| assert!(guest.comes_in() && guest.is_answered(priority)))
    });
    let own = {
        let bus = Arc::clone(&house.bus);
        thread::spawn(move || assert_eq!(call(&bus, 9, Priority::Read, &mut || false), Ok(())))
    };
    wait_for(&house.bus, 3);
    drop(turn);
    join(programs.into_iter().chain([own]));
    assert_eq!(sent_by(&house.sent).first(), Some(&2));
    house.close();
}

/// A program that is gone, however far it had come: nobody waits for it.
pub(super) fn a_program_goes() {
    let house = House::open();
    clock::set(true);
    let goes = house.program(1, |mut guest| {
        let far = thread_rng().gen_range(0..3);
        if far > 0 && guest.comes_in() && far > 1 {
            guest.asks(Priority::Write);
        }
    });
    let stays = house.program(2, |mut guest| assert!(guest.comes_in() && guest.is_answered(Priority::Write)));
    assert_eq!(call(&house.bus, 9, Priority::Read, &mut || false), Ok(()));
    join([goes, stays]);
    house.close();
}

/// A program that takes back what it asked for is told of that once, and may ask again.
pub(super) fn a_program_takes_back() {
    let house = House::open();
    clock::set(true);
    let program = house.program(1, |mut guest| {
        assert!(guest.comes_in() && guest.asks(Priority::Write));
        assert!(guest.channel.say(&Wish::Cancel).is_ok());
        assert!(matches!(guest.hears(), Some(Told::Answer { .. } | Told::Failed { .. })));
        assert!(guest.is_answered(Priority::Write));
    });
    assert_eq!(call(&house.bus, 9, Priority::Read, &mut || false), Ok(()));
    join([program]);
    house.close();
}

/// While the system gives no descriptors, who knocks waits, and is let in then.
pub(super) fn the_system_refuses_for_a_while() {
    let house = House::with(Listener::refusing(2));
    let program = house.program(1, |mut guest| assert!(guest.comes_in() && guest.is_answered(Priority::Write)));
    join([program]);
    assert_eq!(house.door.note(), None, "it gives again");
    house.close();
}

/// Who is in and asks for nothing hears of the end of the bus.
pub(super) fn who_is_in_is_ended() {
    let house = House::open();
    let (tell, is_in) = channel();
    let program = house.program(1, move |mut guest| {
        assert!(guest.comes_in() && guest.is_answered(Priority::Write));
        assert!(tell.send(()).is_ok());
        assert_eq!(guest.hears(), None);
    });
    assert!(is_in.recv().is_ok());
    house.close();
    join([program]);
}

/// A bus that is closed while programs come in and ask: each is answered, told, or finds its connection ended.
pub(super) fn a_bus_with_guests_is_closed() {
    let house = House::open();
    clock::set(true);
    let programs = [1, 2].map(|number| {
        house.program(number, |mut guest| {
            if guest.comes_in() && guest.asks(Priority::Write) {
                guest.hears();
            }
        })
    });
    let (entrances, sent) = (Arc::clone(&house.entrances), Arc::clone(&house.sent));
    house.close();
    let by_then = sent_by(&sent);
    // The system ends who still knocks when the last who listens is gone.
    drop(entrances);
    join(programs);
    assert_eq!(sent_by(&sent), by_then, "nothing is sent behind the close");
}

/// Who wants to know how often the port was opened again is told of each time, also of one that falls between.
pub(super) fn an_opening_is_told() {
    let house = House::open();
    let program = house.program(1, |mut guest| {
        assert!(guest.comes_in() && guest.channel.say(&Wish::Reconnects).is_ok());
        while !matches!(guest.hears(), Some(Told::Reconnects(2))) {}
    });
    for _ in 0..2 {
        house.bus.port().lock().close();
        assert_eq!(call(&house.bus, 9, Priority::Read, &mut || false), Ok(()));
        house.door.reopened(house.bus.reconnects());
    }
    join([program]);
    house.close();
}
