//! Clients of tokio-modbus in the crowd before a gateway (`tests/conformance/gateways`): each reads again and again, and
//! knows what is true.
//!
//! `cargo run --release -p drivebus-benches --example crowd < ORDER`
//!
//! The order is JSON, as `crowd_clients.py` says, and so is the answer: how the reads ended.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and prints")]

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Deserialize;
use tokio::net::TcpSocket;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_modbus::client::{Context, Reader, tcp};
use tokio_modbus::slave::{Slave, SlaveContext};

const RIGHT: &str = "right";
const WRONG: &str = "wrong";
const ERROR: &str = "error";
const NONE: &str = "none";

type Ends = BTreeMap<&'static str, u64>;

/// What is asked, and what is true.
#[derive(Debug, Deserialize)]
struct Question {
    unit: u8,
    address: u16,
    words: Vec<u16>,
}

/// What the clients do. Times are in seconds.
#[derive(Debug, Deserialize)]
struct Order {
    host: IpAddr,
    port: u16,
    seconds: f64,
    sources: Vec<IpAddr>,
    questions: Vec<Question>,
    seed: u64,
    timeout: f64,
    pause: f64,
}

/// Numbers that are the same in each run, and others for each client.
struct Chance(u64);

impl Chance {
    fn new(seed: u64, place: usize) -> Self {
        // An odd number, so never 0, in which the generator would stay.
        Self((seed << 32 | place as u64) << 1 | 1)
    }

    fn one_of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        let place = (self.0 >> 32) % all.len() as u64;
        &all[usize::try_from(place).unwrap()]
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() {
    let order: Arc<Order> = Arc::new(serde_json::from_reader(io::stdin()).unwrap());
    let mut clients = JoinSet::new();
    for place in 0..order.sources.len() {
        clients.spawn(one(Arc::clone(&order), place));
    }
    let mut all = Ends::new();
    while let Some(ends) = clients.join_next().await {
        for (end, count) in ends.unwrap() {
            *all.entry(end).or_default() += count;
        }
    }
    println!("{}", serde_json::to_string(&all).unwrap());
}

/// One client, until the time is over.
async fn one(order: Arc<Order>, place: usize) -> Ends {
    let mut chance = Chance::new(order.seed, place);
    let until = Instant::now() + Duration::from_secs_f64(order.seconds);
    let mut ends = Ends::new();
    let mut there = None;
    while Instant::now() < until {
        let question = chance.one_of(&order.questions);
        let asked = timeout(Duration::from_secs_f64(order.timeout), ask(&order, place, question, &mut there));
        let end = asked.await.unwrap_or(NONE);
        *ends.entry(end).or_default() += 1;
        if end != RIGHT {
            sleep(Duration::from_secs_f64(order.pause)).await;
        }
    }
    ends
}

/// One read, and how it ended. A connection that failed, or whose read was given up, is not kept: what comes late on it
/// would be taken for the next answer, and refused.
async fn ask(order: &Order, place: usize, question: &Question, there: &mut Option<Context>) -> &'static str {
    let mut context = match there.take() {
        Some(context) => context,
        None => match connected(order, order.sources[place]).await {
            Ok(context) => context,
            Err(_) => return ERROR,
        },
    };
    context.set_slave(Slave(question.unit));
    let count = u16::try_from(question.words.len()).unwrap();
    let end = match context.read_holding_registers(question.address, count).await {
        Ok(Ok(words)) if words == question.words => RIGHT,
        Ok(Ok(_)) => WRONG,
        Ok(Err(_)) => ERROR,
        Err(_) => return ERROR,
    };
    *there = Some(context);
    end
}

/// A connection that comes from an address, as from a machine of its own.
async fn connected(order: &Order, source: IpAddr) -> io::Result<Context> {
    let socket = TcpSocket::new_v4()?;
    socket.bind(SocketAddr::new(source, 0))?;
    let stream = socket.connect(SocketAddr::new(order.host, order.port)).await?;
    Ok(tcp::attach(stream))
}
