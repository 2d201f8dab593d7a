//! A device may have several nodes: a wireless receiver has one per device that it can be paired with, all under the same
//! vendor and product, and only the first push of the cap shows which of them is the hand.

use crate::hid::{HidPort, ReadFailure};
use crate::lights::Lights;
use crate::{HidReport, RawReport};
use std::time::Duration;

/// How long one node is waited for before the next has its turn. A report is late by at most this for each other node, and
/// only until the hand is known.
const TURN: Duration = Duration::from_millis(2);

/// Every node of one device, until one of them speaks as a hand controller; from then on that one alone.
pub(crate) struct HidNodes(Vec<Box<dyn HidPort>>);

impl HidNodes {
    /// The open nodes of one device.
    pub(crate) fn new(nodes: Vec<Box<dyn HidPort>>) -> Self {
        Self(nodes)
    }

    /// Closes every other node.
    fn keep(&mut self, hand_idx: usize) {
        let hand = self.0.swap_remove(hand_idx);
        self.rest_lights();
        self.0 = vec![hand];
    }
}

impl HidPort for HidNodes {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        if let [hand] = self.0.as_mut_slice() {
            return hand.read(buffer, timeout);
        }
        let n_turns = timeout.as_millis() / (TURN.as_millis() * self.0.len().max(1) as u128);
        for _ in 0..n_turns.max(1) {
            for node_idx in 0..self.0.len() {
                let n_bytes = self.0[node_idx].read(buffer, TURN)?;
                if n_bytes > 0 {
                    if is_of_a_hand(&buffer[..n_bytes.min(RawReport::MAX_BYTES)]) {
                        self.keep(node_idx);
                    }
                    return Ok(n_bytes);
                }
            }
        }
        Ok(0)
    }

    fn show(&mut self, lights: Lights) {
        self.0.iter_mut().for_each(|node| node.show(lights));
    }

    fn rest_lights(&mut self) {
        self.0.iter_mut().for_each(|node| node.rest_lights());
    }
}

/// The battery of a device speaks on any node; cap and buttons only on the hand's own.
fn is_of_a_hand(bytes: &[u8]) -> bool {
    HidReport::decode(bytes).is_ok_and(|report| report.is_motion() || matches!(report, HidReport::Buttons(_)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::LightRole;
    use std::collections::VecDeque;
    use std::sync::{Arc, Mutex};

    /// What a test's node will say, whether it is lit, and how often it was read.
    #[derive(Default)]
    struct Node {
        reports: VecDeque<Vec<u8>>,
        is_lit: bool,
        n_reads: u32,
    }

    struct NodePort(Arc<Mutex<Node>>);

    impl HidPort for NodePort {
        fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], _: Duration) -> Result<usize, ReadFailure> {
            let mut node = self.0.lock().expect("node");
            node.n_reads += 1;
            let Some(report) = node.reports.pop_front() else { return Ok(0) };
            buffer[..report.len()].copy_from_slice(&report);
            Ok(report.len())
        }

        fn show(&mut self, lights: Lights) {
            self.0.lock().expect("node").is_lit = lights.is_lit(LightRole::All);
        }

        fn rest_lights(&mut self) {
            self.0.lock().expect("node").is_lit = false;
        }
    }

    fn nodes(said: [&[&[u8]]; 3]) -> ([Arc<Mutex<Node>>; 3], HidNodes) {
        let nodes = said.map(|reports| {
            let reports = reports.iter().map(|report| report.to_vec()).collect();
            Arc::new(Mutex::new(Node { reports, ..Node::default() }))
        });
        let ports = nodes.iter().map(|node| Box::new(NodePort(Arc::clone(node))) as Box<dyn HidPort>).collect();
        (nodes, HidNodes::new(ports))
    }

    fn read(port: &mut HidNodes) -> Vec<u8> {
        let mut buffer = [0; RawReport::MAX_BYTES];
        let n_bytes = port.read(&mut buffer, Duration::from_millis(50)).expect("a read");
        buffer[..n_bytes].to_vec()
    }

    #[test]
    fn the_node_that_speaks_as_a_hand_is_kept_and_the_others_are_left_alone() {
        let (nodes, mut port) = nodes([&[], &[&[3, 1, 0], &[3, 0, 0]], &[]]);
        port.show(Lights::default());
        assert_eq!(read(&mut port), [3, 1, 0]);
        let lit = nodes.each_ref().map(|node| node.lock().expect("node").is_lit);
        assert_eq!(lit, [false, true, false]);
        let n_reads = nodes[0].lock().expect("node").n_reads;
        assert_eq!(read(&mut port), [3, 0, 0]);
        assert_eq!(nodes[0].lock().expect("node").n_reads, n_reads, "a node that was closed is not read");
    }

    #[test]
    fn a_battery_or_a_foreign_report_does_not_make_a_node_the_hand() {
        let (_, mut port) = nodes([&[&[0x17, 50, 0], &[9, 9]], &[], &[&[1, 5, 0, 0, 0, 0, 0]]]);
        assert_eq!(read(&mut port), [0x17, 50, 0]);
        assert_eq!(read(&mut port), [9, 9], "it is handed on to be counted");
        assert_eq!(read(&mut port), [1, 5, 0, 0, 0, 0, 0]);
        assert_eq!(port.0.len(), 1);
    }

    #[test]
    fn silence_of_all_nodes_is_silence() {
        let (nodes, mut port) = nodes([&[], &[], &[]]);
        assert_eq!(read(&mut port), [0_u8; 0]);
        assert!(nodes.iter().all(|node| node.lock().expect("node").n_reads > 0));
    }
}
