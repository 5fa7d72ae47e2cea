//! Independent runs, one on each core.

use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Result;

/// Does `work` for 0..count, one at a time on each core, and returns the results in order. Each worker has a rayon pool of its
/// own with one thread, so that a run stays on its core and its CPU seconds are its own.
///
/// # Errors
/// If a pool cannot be made or a piece of work panicked.
pub fn on_each_core<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Result<Vec<T>> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get).min(count.max(1));
    let next = AtomicUsize::new(0);
    let worker = || -> Result<Vec<(usize, T)>> {
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return Ok(results);
            }
            results.push((index, alone.install(|| work(index))));
        }
    };
    let mut results = std::thread::scope(|scope| -> Result<Vec<_>> {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(worker)).collect();
        let mut all = Vec::new();
        for worker in workers {
            all.extend(worker.join().map_err(|_| anyhow::anyhow!("a run panicked"))??);
        }
        Ok(all)
    })?;
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    #[test]
    fn results_come_in_order_and_none_is_missing() {
        let squares = super::on_each_core(20, |index| index * index).unwrap();
        assert_eq!(squares, (0..20).map(|index| index * index).collect::<Vec<_>>());
    }
}
