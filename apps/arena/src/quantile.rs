//! One number for many.

/// The value below which `share` of the values lie, by the nearest rank; None for none.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((values.len() as f64 - 1.0) * share).round() as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_by_hand() {
        assert_eq!((quantile(&[3.0, 1.0, 2.0], 0.5), quantile(&[3.0, 1.0, 2.0], 1.0)), (Some(2.0), Some(3.0)));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
