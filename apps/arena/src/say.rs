//! What goes to stdout. A reader who has seen enough (`| head`) ends nothing; a disk that is full does, with a sentence.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

/// `println!` that does not panic when nobody reads on.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::say::say(format_args!($($argument)*)) };
}

/// Writes a line to stdout.
pub fn say(line: Arguments<'_>) {
    match writeln!(std::io::stdout(), "{line}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            eprintln!("error: writing to stdout: {error}");
            std::process::exit(2);
        }
        _ => (),
    }
}
