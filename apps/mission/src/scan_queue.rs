//! Scans that wait until the IMU and the encoder have passed their end.
//!
//! A scan is complete when its last point has come, but the sensors that say how it moved may be later by some
//! milliseconds: on a robot they come over other wires, in a bag they were written by other nodes.

use std::collections::VecDeque;

use omni_perception::RawScan;

/// Scans that may wait; of more the oldest is tried as it is, and refused with the reason.
const MAX_WAITING: usize = 10;

/// The queue before whatever needs the motion during a scan.
#[derive(Debug, Clone, Default)]
pub struct ScanQueue {
    waiting: VecDeque<RawScan>,
}

impl ScanQueue {
    /// A scan came.
    pub fn push(&mut self, scan: RawScan) {
        self.waiting.push_back(scan);
    }

    /// The oldest scan, if what happened during it `is_known`, or it has waited too long.
    pub fn next_if(&mut self, is_known: impl Fn(&RawScan) -> bool) -> Option<RawScan> {
        let is_too_long = self.waiting.len() > MAX_WAITING;
        self.waiting.pop_front_if(|scan| is_too_long || is_known(scan))
    }

    /// Scans that still wait.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Gives up what still waits.
    pub fn clear(&mut self) {
        self.waiting.clear();
    }
}
