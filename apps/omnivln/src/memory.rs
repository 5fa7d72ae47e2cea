//! What this process takes of the memory, as the system counts it. Linux only; elsewhere nobody says.

use std::fs;

/// Peak so far, MiB.
pub fn peak_rss_mib() -> Option<f64> {
    of_status("VmHWM:")
}

/// Held now, MiB.
pub fn rss_mib() -> Option<f64> {
    of_status("VmRSS:")
}

/// Runs some work; what it took at its peak beyond what there was before, bytes.
pub fn peak_extra_bytes<T>(work: impl FnOnce() -> T) -> (T, Option<f64>) {
    // "5" sets the peak back to what is held now.
    let is_reset = fs::write("/proc/self/clear_refs", "5").is_ok();
    let before = of_status("VmRSS:").filter(|_| is_reset);
    let result = work();
    let extra = before.zip(peak_rss_mib()).map(|(before, peak)| (1024.0 * 1024.0 * (peak - before)).max(0.0));
    (result, extra)
}

fn of_status(key: &str) -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn forty_megabytes_are_seen_and_their_return_is_not() {
        let (sum, extra) = peak_extra_bytes(|| {
            let filled: Vec<u8> = (0..40_000_000_u32).map(|i| i as u8 | 1).collect();
            filled.iter().map(|v| u64::from(*v)).sum::<u64>()
        });
        let Some(extra) = extra else {
            println!("skipped: the system does not let the peak be set back");
            return;
        };
        assert!(sum > 0 && (3e7..8e7).contains(&extra), "{extra}");
    }
}
