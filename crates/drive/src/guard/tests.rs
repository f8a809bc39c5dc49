//! Codes and registers below are those of the manuals, as the profiles name them.

use drivebus_drives::Profile;
use proptest::prelude::*;

use super::*;

fn of(name: &str) -> Arc<Family> {
    Families::shipped().family(&Profile::builtin(name).unwrap())
}

fn check(names: &[&str], first: impl Into<Place>, words: &[u16]) -> Option<String> {
    let unit: Vec<_> = names.iter().copied().map(of).collect();
    Families::shipped().check(&unit, first.into(), words).err().map(|why| why.to_string())
}

/// GD350 manual, section 9.4.5: 1 to 8 at 2000H.
#[test]
fn a_command_register_takes_what_the_family_defines_there() {
    for word in 0..=u16::MAX {
        assert_eq!(check(&["gd350"], 0x2000, &[word]).is_none(), (1..=8).contains(&word), "{word}");
    }
    let unit = [of("gd350")];
    let Err(Forbidden::Undefined { family, place, word, codes }) =
        Families::shipped().check(&unit, 0x2000.into(), &[9])
    else {
        panic!("it is no command of a GD350");
    };
    assert_eq!((family.name(), place, word), ("gd350", 0x2000.into(), 9));
    assert_eq!((codes.len(), codes.get(&5).map(String::as_str)), (8, Some("stop")));
}

/// EDS300 manual, p. 44, has 9 and 10 at the same register.
#[test]
fn a_unit_of_which_more_is_possible_may_get_the_commands_of_each() {
    assert_eq!(check(&["gd350", "eds300"], 0x2000, &[9]), None);
    assert_eq!(check(&["eds300", "gd350"], 0x2000, &[10]), None);
    let why = check(&["gd350", "eds300"], 0x2000, &[11]);
    assert_eq!(why.as_deref(), Some("000BH at 2000H is no command of INVT Goodrive350"));
    // 7000H is a command register of one of them only, and its words count there.
    assert_eq!(check(&["gd350", "vfd500"], 0x7000, &[7]), None);
    assert!(check(&["gd350", "vfd500"], 0x7000, &[9]).is_some());
}

/// GD350 manual, section 9.4.4: bit 15 of an address says where a parameter is kept, and a drive may leave it out of account.
#[test]
fn a_command_register_is_one_with_the_bit_of_the_memory_too() {
    assert_eq!(check(&["gd350"], 0xA000, &[5]), None);
    let why = check(&["gd350"], 0xA000, &[9]);
    assert_eq!(why.as_deref(), Some("0009H at A000H is no command of INVT Goodrive350"));
    // No other table has such addresses.
    assert_eq!(check(&["gd350"], Place::new(Table::Coil, 0xA000), &[1]), None);
    assert_eq!(check(&["gd350"], Place::new(Table::Input, 0x2000), &[9]), None);
}

/// VFD500 manual, p. 135: its commands go to 7000H. An A1000 takes them at 0001H, where a GD350 has P00.01.
#[test]
fn where_only_others_are_commanded_nothing_is_written() {
    let families = Families::shipped();
    let unit = [of("gd350")];
    for place in [0x7000, 0xF000] {
        let Err(Forbidden::Foreign { family, place: told, others }) = families.check(&unit, place.into(), &[6]) else {
            panic!("a VFD500 takes commands there");
        };
        assert_eq!((family.name(), told), ("gd350", place.into()));
        assert!(others.iter().any(|other| other.name() == "vfd500"));
    }
    assert!(families.commanded_at(0x0001.into()).iter().any(|family| family.name() == "a1000"));
    assert_eq!(check(&["gd350"], 0x0001, &[1]), None);
    assert!(families.commanded_at(0x7001.into()).is_empty());
    assert_eq!(check(&["gd350"], 0x7001, &[1]), None);
}

#[test]
fn each_word_counts_where_it_goes() {
    assert_eq!(check(&["gd350"], 0x1FFF, &[9, 5, 9]), None);
    assert!(check(&["gd350"], 0x1FFF, &[5, 9]).is_some());
    assert!(check(&["gd350"], 0x1FFE, &[9, 9, 9]).is_some());
    // What would go behind the last address goes nowhere: neither to 0000H nor to another table.
    assert_eq!(check(&["acs355"], 0xFFFF, &[0xFFFF, 0xFFFF]), None);
    assert_eq!(check(&[], 0x2000, &[9]), None);
}

proptest! {
    /// By the tables of the profiles, asked in a plainer way.
    #[test]
    fn only_commands_are_held_against_anybody(
        chosen in prop::collection::vec(0..100_usize, 1..4),
        table in 0..4_usize,
        address: u16,
        near in 0..3_usize,
        word in prop_oneof![0..16_u16, any::<u16>()],
    ) {
        let families = Families::shipped();
        let all: Vec<_> = families.iter().cloned().collect();
        let unit: Vec<_> = chosen.iter().map(|&at| Arc::clone(&all[at % all.len()])).collect();
        let registers: Vec<_> = all.iter().flat_map(|family| family.profile().command_registers().into_keys()).collect();
        // Hardly any place is where something is commanded, so two of three are taken from there.
        let register = registers[usize::from(address) % registers.len()];
        let place = match near {
            0 => Place::new(Table::ALL[table], address),
            1 => register,
            _ => Place { address: register.address | 0x8000, ..register },
        };
        let takes = |family: &Arc<Family>, at: Place| family.profile().command_registers().contains_key(&at);
        let defines = |family: &Arc<Family>, at: Place| {
            family.profile().command_registers().get(&at).is_some_and(|codes| codes.contains_key(&word))
        };
        match families.check(&unit, place, &[word]) {
            Err(Forbidden::Undefined { family, codes, .. }) => {
                prop_assert!(unit.iter().any(|each| each.name() == family.name()));
                prop_assert!(!codes.contains_key(&word));
                prop_assert!(!unit.iter().any(|each| defines(each, place)));
            }
            Err(Forbidden::Foreign { others, .. }) => {
                prop_assert!(!others.is_empty());
                prop_assert!(!unit.iter().any(|each| takes(each, place)));
                prop_assert!(!unit.iter().any(|each| each.profile().entry_at(place).is_some()));
            }
            Ok(()) => {
                let is_own = unit.iter().any(|each| takes(each, place));
                prop_assert!(!is_own || unit.iter().any(|each| defines(each, place)));
                let is_foreign =
                    all.iter().any(|each| each.protocol() == unit[0].protocol() && takes(each, place));
                let plain = |each: &Arc<Family>| each.profile().stored_address(place).map_or(place, Place::from);
                let is_known = |each: &Arc<Family>| {
                    [place, plain(each)].into_iter().any(|at| each.profile().entry_at(at).is_some() || takes(each, at))
                };
                // Or it is the address with the usual bit, of a family that says nothing of one.
                prop_assert!(!is_foreign || unit.iter().any(is_known) || place.address & USUAL_MEMORY_BIT != 0);
            }
        }
    }
}
