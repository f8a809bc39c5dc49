//! Ports as people write them, by the vectors that pytest reads too: `tests/vectors/urls.toml`.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::fs;

use drivebus::line::url::{Known, PortUrl};
use drivebus::sim::FaultKind;
use drivebus::{Bus, ErrorKind, Profile};
use serde::Deserialize;

#[derive(Deserialize)]
struct Document {
    url: Vec<Vector>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    port: String,
    scheme: Option<String>,
    host: Option<String>,
    number: Option<u16>,
    #[serde(default)]
    units: BTreeMap<String, String>,
    #[serde(default)]
    r#virtual: bool,
    seed: Option<String>,
    #[serde(default)]
    strict: bool,
    #[serde(default)]
    echo: bool,
    #[serde(default)]
    faults: BTreeMap<String, f64>,
    error: Option<String>,
}

fn vectors() -> Vec<Vector> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/urls.toml");
    toml::from_str::<Document>(&fs::read_to_string(path).unwrap()).unwrap().url
}

fn parse(port: &str) -> PortUrl {
    let families: Vec<&str> = Profile::builtin_names().collect();
    let faults = FaultKind::ALL.map(FaultKind::name);
    PortUrl::parse(port, &Known::default().families(&families).faults(&faults)).unwrap()
}

#[test]
fn a_port_is_what_it_says() {
    for url in vectors().into_iter().filter(|url| url.error.is_none()) {
        let (scheme, server) = match parse(&url.port) {
            PortUrl::Path(path) => {
                assert_eq!(path, url.port);
                ("", None)
            }
            PortUrl::RtuOverTcp(server) => ("socket", Some(server)),
            PortUrl::ModbusTcp(server) => ("tcp", Some(server)),
            PortUrl::Simulator(simulator) => {
                let units = simulator.units.iter().map(|(unit, family)| (unit.to_string(), family.clone()));
                assert_eq!(units.collect::<BTreeMap<_, _>>(), url.units, "{}", url.port);
                assert_eq!(simulator.seed.to_string(), url.seed.unwrap_or("0".to_owned()), "{}", url.port);
                assert_eq!(simulator.faults.into_iter().collect::<BTreeMap<_, _>>(), url.faults, "{}", url.port);
                let flags = (simulator.is_virtual, simulator.strict_silence, simulator.echo);
                assert_eq!(flags, (url.r#virtual, url.strict, url.echo), "{}", url.port);
                ("sim", None)
            }
            other => panic!("{other:?}"),
        };
        assert_eq!(Some(scheme), url.scheme.as_deref(), "{}", url.port);
        let (host, number) = server.map(|server| (server.host, server.port)).unzip();
        assert_eq!((host, number), (url.host, url.number), "{}", url.port);
    }
}

#[test]
fn what_is_wrong_is_named() {
    let families = Profile::builtin_names().collect::<Vec<_>>().join(", ");
    let faults = FaultKind::ALL.map(FaultKind::name).join(", ");
    let options = format!("clock, seed, strict_silence, echo, faults, {faults}");
    for (port, error) in vectors().into_iter().filter_map(|url| Some((url.port, url.error?))) {
        let schemes = "socket://, tcp://, sim://";
        let error = error.replace("{families}", &families).replace("{options}", &options).replace("{schemes}", schemes);
        let refused = Bus::open(&port).unwrap_err();
        assert_eq!((refused.kind(), refused.to_string()), (ErrorKind::NotAllowed, error));
    }
}

#[test]
fn a_simulator_is_what_its_url_asks_for() {
    let bus = Bus::open("sim://1=gd350,7=vfd500?clock=virtual&seed=7&faults=0.02&late=0.5&echo=1").unwrap();
    let simulator = bus.simulator().unwrap();
    assert_eq!((simulator.name(), simulator.is_realtime()), ("sim:1=gd350,7=vfd500", false));
    assert!(simulator.wire().echo());
    for (kind, rate) in simulator.wire().rates() {
        assert!((rate - if kind == FaultKind::Late { 0.5 } else { 0.02 }).abs() < 1e-9, "{kind}");
        assert_ne!(kind, FaultKind::Unplug, "nobody asked for that");
    }
    let too_often = Bus::open("sim://gd350?late=2").unwrap_err();
    assert_eq!(too_often.to_string(), "rate 2 of late is not a number from 0.0 to 1.0");
}
