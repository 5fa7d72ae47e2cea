//! What to do with a fault in a file: stop at the first, or note it, drop what is broken and read on.

use crate::load::LoadError;

/// More faults than these are counted, not kept.
const MAX_KEPT: usize = 1000;

/// The faults of a file as it is read.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    is_salvage: bool,
    /// The first thousand.
    pub found: Vec<LoadError>,
    /// All of them.
    pub count: usize,
}

impl Faults {
    /// The first fault ends the reading.
    pub fn fatal() -> Faults {
        Faults::default()
    }

    /// Faults are kept, and cost only the record they are in.
    pub fn salvage() -> Faults {
        Faults { is_salvage: true, ..Faults::default() }
    }

    /// Keeps a fault, or gives it back where it is fatal.
    pub fn note(&mut self, fault: LoadError) -> Result<(), LoadError> {
        if !self.is_salvage {
            return Err(fault);
        }
        self.count += 1;
        if self.found.len() < MAX_KEPT {
            self.found.push(fault);
        }
        Ok(())
    }

    /// The same where something is left out because of it.
    pub fn instead<T>(&mut self, fault: LoadError) -> Result<Option<T>, LoadError> {
        self.note(fault).map(|()| None)
    }

    /// Leaves out of a list what is at fault.
    pub fn retain<T>(
        &mut self,
        list: &mut Vec<T>,
        mut check: impl FnMut(&T) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        let mut result = Ok(());
        list.retain(|item| match check(item) {
            Ok(()) => true,
            Err(fault) => {
                if result.is_ok() {
                    result = self.note(fault);
                }
                false
            }
        });
        result
    }

    /// Empties a field that is at fault.
    pub fn keep<T>(
        &mut self,
        field: &mut Option<T>,
        check: impl FnOnce(&T) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        match field.as_ref().map(check) {
            Some(Err(fault)) => {
                *field = None;
                self.note(fault)
            }
            _ => Ok(()),
        }
    }
}
