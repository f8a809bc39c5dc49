//! Answers whose length nobody knows, handed over in lumps: they end where nothing follows, not at the first pause.

use drivebus_rtu::*;

const PAUSE: Duration = Duration::from_millis(20);
const T35: Duration = Duration::from_micros(3_646); // 9600 8N1

fn at(micros: u64) -> Instant {
    Instant::from_nanos(micros * 1_000)
}

fn unit() -> UnitAddress {
    UnitAddress::new(1).unwrap()
}

/// A device identification (2BH) of 25 bytes on the wire, as a CFW drive gives it.
fn answer() -> Vec<u8> {
    let mut answer = vec![0x01, 0x2B, 0x0E, 0x01, 0x81, 0, 0, 2, 1, 9];
    answer.extend_from_slice(b"CFW-X 10A\x02\x05V4.50");
    answer.extend_from_slice(&crc16(&answer).to_le_bytes());
    answer
}

fn framer(pdu: &[u8]) -> Framer {
    let mut framer = Framer::new(T35);
    framer.expect(unit(), Request::custom(pdu, AnswerLength::BySilence).unwrap().expected());
    framer.wait_for_the_rest(PAUSE, at(0));
    framer
}

/// Hands `wire` over in lumps of `lump` bytes, `apart` microseconds apart, looking whenever the framer asks for it.
fn in_lumps(framer: &mut Framer, wire: &[u8], lump: usize, apart: u64) -> (Vec<Vec<u8>>, Vec<u8>) {
    let (mut heard, mut noise) = (Vec::new(), Vec::new());
    let mut take = |framer: &mut Framer, now| {
        while let Some(found) = framer.poll(now) {
            match found {
                Ok(frame) => heard.push(frame.as_bytes().to_vec()),
                Err(skipped) => noise.extend_from_slice(skipped.bytes),
            }
        }
    };
    let mut now = 0;
    for piece in wire.chunks(lump) {
        framer.receive(at(now), piece);
        take(framer, at(now));
        now += apart;
        while let Some(moment) = framer.deadline().filter(|moment| *moment < at(now)) {
            take(framer, moment);
            assert!(framer.deadline().is_none_or(|next| next > moment), "it asks for the same moment again");
        }
    }
    while let Some(moment) = framer.deadline() {
        take(framer, moment);
        assert!(framer.deadline().is_none_or(|next| next > moment), "it asks for the same moment again");
    }
    (heard, noise)
}

#[test]
fn an_answer_of_unknown_length_is_whole_however_it_is_cut() {
    let answer = answer();
    for lump in 1..=answer.len() {
        for apart in [0, 900, 8_334, 16_000, 19_999] {
            let heard = in_lumps(&mut framer(&[0x2B, 0x0E, 1, 0]), &answer, lump, apart);
            assert_eq!(heard, (vec![answer.clone()], Vec::new()), "{lump} bytes, {apart} µs");
        }
    }
}

#[test]
fn a_beginning_that_is_a_frame_by_itself_is_not_taken_for_all_of_it() {
    // The first eight bytes end with their own CRC.
    let mut answer = vec![0x01, 0x41, 1, 2, 3, 4];
    answer.extend_from_slice(&crc16(&answer).to_le_bytes());
    answer.extend_from_slice(&[5, 6, 7, 8, 9]);
    answer.extend_from_slice(&crc16(&answer).to_le_bytes());
    let heard = in_lumps(&mut framer(&[0x41]), &answer, 8, 8_334);
    assert_eq!(heard, (vec![answer], Vec::new()));
}

#[test]
fn what_comes_around_it_is_skipped() {
    let answer = answer();
    for (before, behind) in [(&[0xFF, 0x00][..], &[][..]), (&[], &[0xFF]), (&[0x55], &[0xFF, 0xFF, 0x00])] {
        let wire = [before, &answer, behind].concat();
        for lump in [1, 8, wire.len()] {
            let (frames, noise) = in_lumps(&mut framer(&[0x2B, 0x0E, 1, 0]), &wire, lump, 8_334);
            assert_eq!(frames, std::slice::from_ref(&answer));
            assert_eq!(noise, [before, behind].concat());
        }
    }
}

#[test]
fn one_that_breaks_off_or_is_damaged_is_none() {
    let answer = answer();
    for end in 1..answer.len() {
        assert_eq!(
            in_lumps(&mut framer(&[0x2B, 0x0E, 1, 0]), &answer[..end], 8, 8_334).0,
            Vec::<Vec<u8>>::new(),
            "{end}"
        );
    }
    for at in 0..answer.len() {
        let mut damaged = answer.clone();
        damaged[at] ^= 0x10;
        assert_eq!(in_lumps(&mut framer(&[0x2B, 0x0E, 1, 0]), &damaged, 8, 8_334).0, Vec::<Vec<u8>>::new(), "{at}");
    }
}

#[test]
fn a_named_function_ends_by_its_own_account() {
    let answer = Adu::answer(unit(), &Answer::read(&[1, 2, 3]).unwrap()).as_bytes().to_vec();
    for lump in 1..=answer.len() {
        let mut framer = framer(&[3, 0, 0, 0, 3]);
        let heard = in_lumps(&mut framer, &answer, lump, 8_334);
        assert_eq!(heard, (vec![answer.clone()], Vec::new()), "{lump}");
    }
}

/// The request goes out, and `pieces` come at their moments after it; the event that ends it.
fn asked(patience: Patience, timeout: Duration, pieces: &[(u64, &[u8])]) -> (u64, Option<Vec<u8>>) {
    let format = SerialFormat::new(9_600, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap();
    let mut master = Master::new(&format);
    master.be_patient(Some(patience));
    let request = Request::custom(&[0x2B, 0x0E, 1, 0], AnswerLength::BySilence).unwrap();
    master.begin(at(0), unit().into(), &request, timeout).unwrap();
    let mut now = master.deadline().unwrap();
    assert!(matches!(master.poll(now), Some(Event::Transmit(_))));
    let out = now;
    master.sent(out);
    let mut pieces = pieces.iter().map(|(after, piece)| (out + Duration::from_micros(*after), *piece)).peekable();
    loop {
        let next = master.deadline().unwrap();
        match pieces.next_if(|(moment, _)| *moment <= next) {
            Some((moment, piece)) => {
                now = moment;
                master.receive(now, piece);
            }
            None => now = next,
        }
        if let Some(event) = master.poll(now) {
            let answer = match event {
                Event::Answer(Answer::Custom { pdu, .. }) => Some(pdu.to_vec()),
                _ => None,
            };
            return (now.saturating_duration_since(out).as_micros().try_into().unwrap(), answer);
        }
    }
}

#[test]
fn a_master_waits_at_least_as_long_as_a_receiver_collects() {
    let answer = answer();
    let pieces: Vec<_> = (0..).zip(answer.chunks(8)).map(|(n, piece)| (12_500 + n * 8_334, piece)).collect();
    let patience = Patience::new(Duration::from_millis(10), Duration::from_millis(5));
    let (took, heard) = asked(patience, Duration::from_millis(500), &pieces);
    assert_eq!(heard.as_deref(), Some(&answer[1..answer.len() - 2]));
    // Sixteen characters behind the last lump.
    let last = 12_500 + 3 * 8_334;
    assert!((last + 16_665..=last + 16_667).contains(&took), "{took}");
}

#[test]
fn what_is_whole_at_the_time_out_is_taken() {
    let answer = answer();
    let patience = Patience::new(Duration::from_millis(100), Duration::from_millis(100));
    let timeout = Duration::from_millis(50);
    let (took, heard) = asked(patience, timeout, &[(4_000, &answer)]);
    assert_eq!((took, heard.as_deref()), (50_000, Some(&answer[1..answer.len() - 2])));
    assert_eq!(asked(patience, timeout, &[(4_000, &answer[..20])]), (50_000, None));
}
