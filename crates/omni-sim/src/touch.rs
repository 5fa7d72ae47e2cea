//! From contacts to collisions: how often something new was touched.

use crate::contact::Contact;
use crate::mesh::InstanceId;

/// Counts touches: a new touch of a thing is one collision, a touch that lasts or comes back within a moment is the same.
#[derive(Debug, Clone, Default)]
pub struct TouchCounter {
    /// A thing that was left for at least this long is touched anew.
    pub release_s: f64,
    last: Vec<(InstanceId, i64)>,
    touches: Vec<Contact>,
}

impl TouchCounter {
    /// A counter; half a second is a usual `release_s`.
    pub fn new(release_s: f64) -> Self {
        TouchCounter { release_s, ..TouchCounter::default() }
    }

    /// Takes the contacts of one step; returns how many new touches there are among them.
    pub fn observe(&mut self, contacts: &[Contact]) -> usize {
        let before = self.touches.len();
        for contact in contacts {
            match self.last.iter_mut().find(|(instance, _)| *instance == contact.instance) {
                Some((_, stamp_ns)) => {
                    if (contact.stamp_ns - *stamp_ns) as f64 * 1e-9 >= self.release_s {
                        self.touches.push(*contact);
                    }
                    *stamp_ns = contact.stamp_ns;
                }
                None => {
                    self.last.push((contact.instance, contact.stamp_ns));
                    self.touches.push(*contact);
                }
            }
        }
        self.touches.len() - before
    }

    /// The first contact of every touch so far, in time order.
    pub fn touches(&self) -> &[Contact] {
        &self.touches
    }
}
