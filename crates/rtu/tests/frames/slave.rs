//! What a unit hears on a shared line.

use drivebus_rtu::*;

fn at(micros: u64) -> Instant {
    Instant::from_nanos(micros * 1_000)
}

fn slave() -> Slave {
    Slave::new(UnitAddress::new(2).unwrap(), &SerialFormat::DEFAULT)
}

#[test]
fn requests_for_this_unit_and_for_all_are_heard_others_are_not() {
    let request = Request::write(4, 5000);
    for (address, heard, broadcast) in [(2, true, false), (0, true, true), (3, false, false)] {
        let adu = Adu::request(Destination::from_wire(address).unwrap(), &request);
        let mut slave = slave();
        slave.receive(at(0), adu.as_bytes());
        let expected = if heard {
            SlaveEvent::Request { request, broadcast }
        } else {
            SlaveEvent::Foreign(Frame::parse(adu.as_bytes()).unwrap())
        };
        assert_eq!(slave.poll(at(0)), Some(expected));
        assert_eq!(slave.poll(at(0)), None);
    }
}

#[test]
fn a_good_crc_on_a_wrong_shape_is_malformed() {
    // 03H with one byte too many: only silence shows that it was meant so.
    let body = [2, 3, 0, 0, 0, 1, 0];
    let wire = [&body[..], &crc16(&body).to_le_bytes()].concat();
    let mut slave = slave();
    slave.receive(at(0), &wire);
    assert_eq!(slave.poll(at(0)), None);
    let silent = slave.deadline().unwrap();
    assert_eq!(
        slave.poll(silent),
        Some(SlaveEvent::Malformed { function: 3, error: RequestError::PduLength { len: 6 }, broadcast: false })
    );

    let none = Adu::answer(UnitAddress::new(2).unwrap(), &Answer::custom(&[3, 0, 0, 0, 0]).unwrap());
    slave.receive(at(9_000), none.as_bytes());
    assert_eq!(
        slave.poll(at(9_000)),
        Some(SlaveEvent::Malformed {
            function: 3,
            error: RequestError::Count { count: 0, max: 125 },
            broadcast: false
        })
    );
}

#[test]
fn a_wrong_crc_is_bad_and_the_next_request_is_heard() {
    let request = Request::read(0x2100, 1).unwrap();
    let adu = Adu::request(UnitAddress::new(2).unwrap().into(), &request);
    let mut bad = adu.as_bytes().to_vec();
    bad[7] ^= 1;
    let mut slave = slave();
    slave.receive(at(0), &bad);
    slave.receive(at(10_000), adu.as_bytes());
    assert!(matches!(slave.poll(at(10_000)), Some(SlaveEvent::Bad { error: FrameError::Crc { .. }, .. })));
    assert_eq!(slave.poll(at(10_000)), Some(SlaveEvent::Request { request, broadcast: false }));
}
