//! What is said of the settings of an open port that another program changed, and how often.

/// The changes of one open port, for whoever looks at its settings and sets them again.
#[derive(Debug, Default)]
pub struct SetAgain {
    times: u64,
    latest: String,
    /// What the driver did not take back when it was tried last.
    left: Vec<String>,
}

impl SetAgain {
    /// The settings were looked at, and are as they were.
    pub fn all_is_well(&mut self) {
        self.left.clear();
    }

    /// `changed` was found, such as `9600 bit/s instead of 19200`, and set again; `left` is what is still so.
    ///
    /// In words what was changed. `None` where that was told already, because the driver has not taken it back.
    pub fn tried(&mut self, changed: &[String], left: &[String]) -> Option<String> {
        if !left.is_empty() && self.left == changed {
            return None;
        }
        self.times += 1;
        self.latest = changed.join(", ");
        self.left = left.to_vec();
        let told = format!("another program had changed the settings of the open port ({})", self.latest);
        Some(match left {
            [] => format!("{told}: they are set again"),
            left => format!("{told}, and the driver does not take back {}: make a new bus", left.join(", ")),
        })
    }

    /// How often that was, for people; `None` where it never was.
    pub fn note(&self) -> Option<String> {
        let times = match self.times {
            0 => return None,
            1 => "once".to_owned(),
            times => format!("{times} times"),
        };
        Some(format!("another program changed the settings of the open port {times}, the last time {}", self.latest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(words: &[&str]) -> Vec<String> {
        words.iter().map(|word| (*word).to_owned()).collect()
    }

    #[test]
    fn what_the_driver_keeps_is_told_once() {
        let mut again = SetAgain::default();
        assert_eq!(again.note(), None);
        let speed = said(&["9600 bit/s instead of 19200"]);
        let told = again.tried(&speed, &speed).unwrap();
        assert!(told.contains("does not take back 9600 bit/s"), "{told}");
        assert_eq!(again.tried(&speed, &speed), None);
        let both = said(&["9600 bit/s instead of 19200", "ECHO on"]);
        let told = again.tried(&both, &speed).unwrap();
        assert!(told.contains("ECHO on), and") && told.ends_with("instead of 19200: make a new bus"), "{told}");
        assert_eq!(again.tried(&speed, &speed), None);
        assert!(again.tried(&speed, &[]).is_some(), "it does now");
        again.all_is_well();
        assert!(again.tried(&speed, &speed).is_some(), "it was changed once more");
        assert!(again.note().unwrap().contains("4 times, the last time 9600 bit/s"), "{:?}", again.note());
    }
}
