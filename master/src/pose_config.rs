//! The settings of a pose sender's hand: where it is listened to, and when its motion counts.

use crate::MasterError;
use krait_ipc::settings;
use std::net::SocketAddr;

settings! {
    /// Settings of `--master pose`.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct PoseConfig in "master.pose" {
        /// Address and port of this machine on which packets are awaited, as in "127.0.0.1:5005"; none: `--listen` names it.
        #[serde(skip_serializing_if = "Option::is_none")]
        listen: Option<SocketAddr> = None;
        /// Whether poses may move real drives. false: the packets carry no authentication.
        real_drives: bool = false;
        /// The sender's unit of length, m. 1: it sends metres; 0.001 for millimetres.
        unit_m: f64 = 1.0, 1e-6..=1.0;
        /// Gripper value beyond which the hand takes hold, in the sender's measure. 0.7: of a gripper from 0 to 1.
        closed_at: f64 = 0.7, -1e3..=1e3;
        /// Gripper value beyond which it lets go. 0.3: far enough from `closed_at` that no noise lets go; where it is the larger
        /// one, smaller values are closed.
        open_at: f64 = 0.3, -1e3..=1e3;
        /// Speed of the hand that asks for the full speed of the tip, m/s. 0.25: a tenth of the hand's motion at the tip.
        full_hand_m_per_s: f64 = 0.25, 0.01..=2.0;
        /// The same for turning, rad/s. 2: a quarter of the hand's turn, for joints.
        full_hand_rad_per_s: f64 = 2.0, 0.1..=20.0;
        /// Speed of the hand beyond which a pose has jumped, m/s. 2: no surgeon's hand; what a lost tracker does.
        jump_m_per_s: f64 = 2.0, 0.05..=10.0;
        /// The same for turning, rad/s. 20.
        jump_rad_per_s: f64 = 20.0, 0.5..=100.0;
        /// Time in which the tip makes up for the hand's motion, s. 0.03: smooths packets that come unevenly.
        follow_s: f64 = 0.03, 0.005..=0.2;
        /// Silence after which the sender counts as lost, s. 0.1: three packets of a camera's tracker.
        lease_s: f64 = 0.1, 0.01..=0.5;
        /// Silence after which another sender may take its place, s. 2: nobody takes over in a gap.
        release_s: f64 = 2.0, 0.5..=60.0;
    }
}

impl PoseConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`MasterError::Setting`] or [`MasterError::Pose`] for the first setting that is out of range or does not fit.
    pub fn check(&self) -> Result<(), MasterError> {
        self.check_ranges()?;
        if self.closed_at == self.open_at {
            let (field, found) = ("open_at", self.open_at.to_string());
            return Err(MasterError::Pose { field, found, expected: "another value than closed_at" });
        }
        match self.listen {
            Some(listen) if listen.ip().is_unspecified() || listen.ip().is_multicast() => Err(MasterError::Pose {
                field: "listen",
                found: listen.to_string(),
                expected: "one address of this machine, as in \"127.0.0.1:5005\"; packets carry no authentication",
            }),
            Some(listen) if listen.port() == 0 => Err(MasterError::Pose {
                field: "listen",
                found: listen.to_string(),
                expected: "a port from 1 to 65535, which the sender knows",
            }),
            _ => Ok(()),
        }
    }

    /// Whether a gripper that is (not) closed so far is closed now.
    pub(crate) fn is_closed(&self, gripper: f64, was_closed: bool) -> bool {
        let limit = if was_closed { self.open_at } else { self.closed_at };
        if self.closed_at > self.open_at { gripper > limit } else { gripper < limit }
    }

    /// The silence after which the sender is lost, ns. For a checked configuration.
    pub(crate) fn lease_ns(&self) -> i64 {
        (self.lease_s * 1e9) as i64
    }

    /// The silence after which another may come, ns. For a checked configuration.
    pub(crate) fn release_ns(&self) -> i64 {
        (self.release_s * 1e9) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_is_every_address_or_none_is_refused_by_name() {
        for (listen, named) in [
            ("0.0.0.0:5005", "0.0.0.0:5005: expected one address of this machine"),
            ("[::]:5005", "[::]:5005"),
            ("239.1.1.1:5005", "239.1.1.1"),
            ("127.0.0.1:0", "expected a port"),
        ] {
            let config = PoseConfig { listen: Some(listen.parse().expect("an address")), ..PoseConfig::default() };
            let error = config.check().expect_err("refused").to_string();
            assert!(error.starts_with("[master.pose] listen") && error.contains(named), "{error}");
        }
        let config = PoseConfig { open_at: 0.7, ..PoseConfig::default() };
        assert!(config.check().expect_err("one place").to_string().contains("another value than closed_at"));
        PoseConfig { listen: Some("10.0.0.1:5005".parse().expect("an address")), ..PoseConfig::default() }
            .check()
            .expect("an address that somebody has named");
    }

    #[test]
    fn a_gripper_closes_and_opens_at_two_values_either_way_round() {
        let config = PoseConfig::default();
        assert!(config.is_closed(0.8, false) && !config.is_closed(0.6, false) && config.is_closed(0.6, true));
        assert!(!config.is_closed(0.2, true));
        let other = PoseConfig { closed_at: 0.1, open_at: 0.4, ..config };
        assert!(other.is_closed(0.05, false) && !other.is_closed(0.2, false) && other.is_closed(0.2, true));
        assert!(!other.is_closed(0.5, true));
    }
}
