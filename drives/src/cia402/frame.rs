//! Classic CAN frames with 11-bit numbers, and what they say by CANopen's predefined connection set.
//!
//! Source: CiA 301, predefined connection set, NMT, EMCY, heartbeat. Whatever fits none of it is [`Heard::Other`].

/// Number of this program on the bus: the last one, which no drive of a configuration may have.
pub(crate) const MASTER: u8 = 127;
/// Begin of a cycle: what was told holds from now on, and everybody answers.
pub(crate) const SYNC: u16 = 0x080;
/// What this program tells a drive each cycle is sent to this and its number.
pub(crate) const TO_DRIVE: u16 = 0x200;
/// What a drive answers each cycle is sent from this and its number.
pub(crate) const FROM_DRIVE: u16 = 0x180;
/// Questions for objects go to this and the number of the drive.
pub(crate) const SDO_TO: u16 = 0x600;
/// Answers about objects come from this and the number of the drive.
pub(crate) const SDO_FROM: u16 = 0x580;
/// Signs of life come from this and the number of who lives.
pub(crate) const HEARTBEAT: u16 = 0x700;
/// The state of the network's management in which cyclic frames flow.
pub(crate) const OPERATIONAL: u8 = 5;
/// The state in which a drive is configured.
pub(crate) const PRE_OPERATIONAL: u8 = 127;

/// Commands of the network's management.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Nmt {
    Start = 0x01,
    PreOperational = 0x80,
}

/// A data frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// A frame of at most 8 bytes; what stands behind is cut off. The number has 11 bits.
    pub fn new(id: u16, bytes: &[u8]) -> Self {
        let len = bytes.len().min(8);
        let mut data = [0; 8];
        data[..len].copy_from_slice(&bytes[..len]);
        Self { id: id & 0x7FF, len: len as u8, data }
    }

    /// Its number.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// Its bytes.
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}

/// What a frame says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// A node says something of itself.
    Node(u8, Said),
    /// Somebody does what only a master does: what.
    Master(&'static str),
    /// Nothing that is understood here.
    Other,
}

/// What a node says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Said {
    /// It has started anew.
    BootUp,
    /// It lives, in this state of the network's management.
    Heartbeat(u8),
    /// Why it has failed: an error code of CiA 402; 0: no more.
    Emergency(u16),
    /// Status word, position in counts, torque in parts of a thousand of the rated one.
    Cyclic { status: u16, counts: i32, torque: i16 },
    /// An answer about an object.
    Object([u8; 8]),
}

/// What a frame from the bus says.
pub(crate) fn hear(frame: &Frame) -> Heard {
    let node = (frame.id & 0x7F) as u8;
    match (frame.id & 0x780, frame.data()) {
        (0x000, _) if node == 0 => Heard::Master("network commands (NMT)"),
        (SYNC, _) if node == 0 => Heard::Master("SYNC"),
        (TO_DRIVE, _) if node != 0 => Heard::Master("targets (RPDO)"),
        (SDO_TO, _) if node != 0 => Heard::Master("questions for objects (SDO)"),
        (HEARTBEAT, [_]) if node == MASTER => Heard::Master("the heartbeat of node 127"),
        (_, _) if node == 0 => Heard::Other,
        (HEARTBEAT, [state]) => {
            let state = state & 0x7F;
            Heard::Node(node, if state == 0 { Said::BootUp } else { Said::Heartbeat(state) })
        }
        (SYNC, [low, high, ..]) => Heard::Node(node, Said::Emergency(u16::from_le_bytes([*low, *high]))),
        (FROM_DRIVE, [s0, s1, p0, p1, p2, p3, t0, t1]) => {
            let status = u16::from_le_bytes([*s0, *s1]);
            let counts = i32::from_le_bytes([*p0, *p1, *p2, *p3]);
            Heard::Node(node, Said::Cyclic { status, counts, torque: i16::from_le_bytes([*t0, *t1]) })
        }
        (SDO_FROM, data) => data.try_into().map_or(Heard::Other, |data| Heard::Node(node, Said::Object(data))),
        _ => Heard::Other,
    }
}

/// A command of the network's management for one node, never for all: strangers are left alone.
pub(crate) fn manage(node: u8, command: Nmt) -> Frame {
    Frame::new(0x000, &[command as u8, node])
}

/// This program's sign of life.
pub(crate) fn beat() -> Frame {
    Frame::new(HEARTBEAT + u16::from(MASTER), &[OPERATIONAL])
}

/// Control word and target position for one drive; they hold from the next SYNC on.
pub(crate) fn tell(node: u8, control: u16, counts: i32) -> Frame {
    let ([c0, c1], [p0, p1, p2, p3]) = (control.to_le_bytes(), counts.to_le_bytes());
    Frame::new(TO_DRIVE + u16::from(node), &[c0, c1, p0, p1, p2, p3])
}

/// Bits on the wire of a frame of so many bytes, at worst: bit stuffing and the pause behind it.
pub(crate) fn bits(bytes: i64) -> i64 {
    47 + 8 * bytes + (34 + 8 * bytes - 1) / 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_say_what_the_predefined_connection_set_says_and_any_bytes_are_heard_without_harm() {
        assert_eq!(hear(&Frame::new(0x705, &[0])), Heard::Node(5, Said::BootUp));
        assert_eq!(hear(&Frame::new(0x705, &[0x85])), Heard::Node(5, Said::Heartbeat(5)));
        assert_eq!(hear(&Frame::new(0x083, &[0x10, 0x23, 3, 0, 0, 0, 0, 0])), Heard::Node(3, Said::Emergency(0x2310)));
        let cyclic = Frame::new(0x181, &[0x37, 0x02, 0xFF, 0xFF, 0xFF, 0xFF, 0xF6, 0xFF]);
        assert_eq!(hear(&cyclic), Heard::Node(1, Said::Cyclic { status: 0x0237, counts: -1, torque: -10 }));
        for id in [0x000, 0x080, 0x201, 0x601, 0x77F] {
            assert!(matches!(hear(&Frame::new(id, &[5])), Heard::Master(_)), "{id:03X}");
        }
        let mut state = 1_u64;
        for _ in 0..200_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let bytes = state.to_be_bytes();
            let frame = Frame::new((state >> 40) as u16, &bytes[..usize::from(bytes[7]) % 9]);
            if let Heard::Node(node, _) = hear(&frame) {
                assert!((1..=127).contains(&node));
            }
        }
    }

    #[test]
    fn bits_on_the_wire_are_those_of_the_worst_stuffing() {
        assert_eq!([0, 7, 8].map(bits), [55, 125, 135]);
    }
}
