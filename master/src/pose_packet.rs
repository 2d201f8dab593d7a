//! One packet of a pose sender, taken apart without trust: nine little-endian numbers and nothing that protects them.
//!
//! | bytes | number | meaning |
//! |---|---|---|
//! | 0..8 | 1.0 | kind of packet; no other is known |
//! | 8..16 | gripper | how far it is closed, in the sender's own measure |
//! | 16..40 | x, y, z | position, in the sender's unit of length and frame |
//! | 40..72 | w, x, y, z | orientation, a unit quaternion, in the same frame |

/// A hand's pose as its sender says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePacket {
    /// Gripper, in the sender's own measure.
    pub gripper: f64,
    /// Position in the sender's unit of length.
    pub position: [f64; 3],
    /// Orientation, a unit quaternion w, x, y, z.
    pub orientation: [f64; 4],
}

/// Why a packet does not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseRefusal {
    /// Its size is not that of nine numbers.
    WrongSize,
    /// A number is NaN or infinite.
    NotFinite,
    /// Its first number is not 1.
    UnknownKind,
    /// The orientation is no unit quaternion.
    NotUnit,
    /// The position is further away than any hand.
    OutOfRange,
    /// Another sender is the one that counts.
    AnotherSender,
    /// The pose is further from the one before than a hand can have gone.
    Jumped,
}

impl PoseRefusal {
    /// Every refusal, in the order of its counter.
    pub const ALL: [Self; 7] = [
        Self::WrongSize,
        Self::NotFinite,
        Self::UnknownKind,
        Self::NotUnit,
        Self::OutOfRange,
        Self::AnotherSender,
        Self::Jumped,
    ];

    /// What was expected, for a person who looks at the log.
    pub fn sentence(self) -> &'static str {
        match self {
            Self::WrongSize => "a pose packet was refused: expected 72 bytes, nine little-endian 64-bit numbers",
            Self::NotFinite => "a pose packet was refused: it holds a number that is NaN or infinite",
            Self::UnknownKind => "a pose packet was refused: its first number is not 1.0, the only kind that is known",
            Self::NotUnit => "a pose packet was refused: its orientation is no unit quaternion (w, x, y, z)",
            Self::OutOfRange => {
                "a pose packet was refused: its position is more than 10 m away; check `unit_m` in [master.pose]"
            }
            Self::AnotherSender => "a second sender of poses is ignored: one hand at a time",
            Self::Jumped => "the pose jumped faster than [master.pose] allows: the motion ends until the hand lets go",
        }
    }
}

/// Bytes of a packet.
pub(crate) const N_BYTES: usize = 72;
/// Furthest position that is taken for a hand's, m.
const FURTHEST_M: f64 = 10.0;
/// How far the length of a quaternion may be from 1: what senders lose that compute in single precision, ten times over.
const UNIT_TOLERANCE: f64 = 1e-3;

impl PosePacket {
    /// Takes a packet apart; `unit_m` is the sender's unit of length, m.
    ///
    /// # Errors
    /// [`PoseRefusal`] for every byte string that is not a packet of the table above.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn decode(bytes: &[u8], unit_m: f64) -> Result<Self, PoseRefusal> {
        if bytes.len() != N_BYTES {
            return Err(PoseRefusal::WrongSize);
        }
        let mut numbers = [0.0; 9];
        for (number, bytes) in numbers.iter_mut().zip(bytes.as_chunks().0) {
            *number = f64::from_le_bytes(*bytes);
        }
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(PoseRefusal::NotFinite);
        }
        let [kind, gripper, x, y, z, orientation @ ..] = numbers;
        if kind != 1.0 {
            return Err(PoseRefusal::UnknownKind);
        }
        let length = orientation.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (length - 1.0).abs() > UNIT_TOLERANCE {
            return Err(PoseRefusal::NotUnit);
        }
        if [x, y, z].iter().any(|place| (place * unit_m).abs() > FURTHEST_M) {
            return Err(PoseRefusal::OutOfRange);
        }
        Ok(Self { gripper, position: [x, y, z], orientation: orientation.map(|q| q / length) })
    }

    /// The packet as a sender writes it.
    pub fn encode(&self) -> [u8; N_BYTES] {
        let [x, y, z] = self.position;
        let [qw, qx, qy, qz] = self.orientation;
        let numbers = [1.0, self.gripper, x, y, z, qw, qx, qy, qz];
        let mut bytes = [0; N_BYTES];
        for (place, number) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(numbers) {
            *place = number.to_le_bytes();
        }
        bytes
    }

    /// The turn from another pose to this one, as a vector along its axis in the sender's frame, rad, the short way round.
    pub(crate) fn turn_from_rad(&self, other: &Self) -> [f64; 3] {
        let ([w, x, y, z], [a, b, c, d]) = (self.orientation, other.orientation);
        // this * conjugate(other)
        let scalar = w * a + x * b + y * c + z * d;
        let vector = [x * a - w * b - y * d + z * c, y * a - w * c - z * b + x * d, z * a - w * d - x * c + y * b];
        let sine = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
        if sine == 0.0 {
            return [0.0; 3];
        }
        // A quaternion and its negative are the same orientation.
        let angle_rad = 2.0 * sine.atan2(scalar.abs()) * scalar.signum();
        vector.map(|part| part / sine * angle_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const REST: PosePacket = PosePacket { gripper: 0.0, position: [0.1, -0.2, 0.3], orientation: [1.0, 0.0, 0.0, 0.0] };

    fn turned(axis: [f64; 3], angle_rad: f64) -> PosePacket {
        let [x, y, z] = axis.map(|part| part * (angle_rad / 2.0).sin());
        PosePacket { orientation: [(angle_rad / 2.0).cos(), x, y, z], ..REST }
    }

    #[test]
    fn a_packet_is_read_and_written_the_same_and_everything_else_is_refused_by_name() {
        let bytes = REST.encode();
        assert_eq!(PosePacket::decode(&bytes, 1.0), Ok(REST));
        for n_bytes in (0..120).filter(|n_bytes| *n_bytes != N_BYTES) {
            let other = bytes.iter().copied().cycle().take(n_bytes).collect::<Vec<u8>>();
            assert_eq!(PosePacket::decode(&other, 1.0), Err(PoseRefusal::WrongSize), "{n_bytes}");
        }
        let spoilt = |idx: usize, number: f64| {
            let mut bytes = bytes;
            bytes[idx * 8..idx * 8 + 8].copy_from_slice(&number.to_le_bytes());
            PosePacket::decode(&bytes, 1.0).expect_err("spoilt")
        };
        for idx in 0..9 {
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!(spoilt(idx, number), PoseRefusal::NotFinite);
            }
        }
        assert_eq!(spoilt(0, 2.0), PoseRefusal::UnknownKind);
        assert_eq!(spoilt(2, 10.1), PoseRefusal::OutOfRange);
        assert_eq!(spoilt(5, 0.99), PoseRefusal::NotUnit);
        assert_eq!(spoilt(5, 0.0), PoseRefusal::NotUnit);
        let mut in_mm = bytes;
        in_mm[16..24].copy_from_slice(&120.0_f64.to_le_bytes());
        assert_eq!(PosePacket::decode(&in_mm, 1.0), Err(PoseRefusal::OutOfRange), "millimetres taken for metres");
        assert!(PosePacket::decode(&in_mm, 1e-3).is_ok());
    }

    #[test]
    fn a_turn_is_about_its_own_axis_and_the_same_for_both_signs_of_a_quaternion() {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let (from, to) = (turned([0.6, 0.0, 0.8], 0.7), turned(axis, 0.3));
            let turn = to.turn_from_rad(&REST);
            assert!((0..3).all(|k| (turn[k] - 0.3 * axis[k]).abs() < 1e-12), "{turn:?}");
            let negative = PosePacket { orientation: to.orientation.map(|q| -q), ..to };
            let [a, b] = [to.turn_from_rad(&from), negative.turn_from_rad(&from)];
            assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12), "{a:?} {b:?}");
        }
        assert_eq!(REST.turn_from_rad(&REST), [0.0; 3]);
    }

    proptest! {
        #[test]
        fn no_bytes_lead_to_a_pose_that_is_not_finite(bytes in prop::collection::vec(any::<u8>(), 60..80)) {
            if let Ok(pose) = PosePacket::decode(&bytes, 1.0) {
                prop_assert!(pose.turn_from_rad(&REST).iter().chain(&pose.position).all(|number| number.is_finite()));
            }
        }
    }
}
