//! A share with the two counts behind it, and the spread of an error.

use serde::Serialize;

/// `hits` of `of`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Ratio {
    /// Numerator.
    pub hits: usize,
    /// Denominator.
    pub of: usize,
    /// Their quotient; `None` where there was nothing to count.
    pub value: Option<f64>,
}

impl Ratio {
    /// `hits` of `of`.
    pub fn new(hits: usize, of: usize) -> Ratio {
        Ratio { hits, of, value: (of > 0).then(|| hits as f64 / of as f64) }
    }

    /// Of all that `marks` goes through, how many are true.
    pub fn counted(marks: impl IntoIterator<Item = bool>) -> Ratio {
        let (mut hits, mut of) = (0, 0);
        for mark in marks {
            of += 1;
            hits += usize::from(mark);
        }
        Ratio::new(hits, of)
    }

    /// All of them together: counts are added, so that a large building weighs more than a small one.
    pub fn pooled(ratios: impl IntoIterator<Item = Ratio>) -> Ratio {
        let (hits, of) = ratios.into_iter().fold((0, 0), |(hits, of), ratio| (hits + ratio.hits, of + ratio.of));
        Ratio::new(hits, of)
    }
}

/// How large errors are.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Half of the errors are below; `None` without any.
    pub median: Option<f64>,
    /// Nine tenths are below.
    pub p90: Option<f64>,
    /// How many there are.
    pub count: usize,
    /// The errors themselves, ascending.
    #[serde(skip)]
    pub all: Vec<f64>,
}

impl Spread {
    /// Of these errors.
    pub fn of(errors: impl IntoIterator<Item = f64>) -> Spread {
        let mut all: Vec<f64> = errors.into_iter().collect();
        all.sort_by(f64::total_cmp);
        let at = |share: f64| all.get(((all.len() as f64 * share) as usize).min(all.len().saturating_sub(1))).copied();
        Spread { median: at(0.5), p90: at(0.9), count: all.len(), all }
    }

    /// Of all errors of several.
    pub fn pooled<'a>(spreads: impl IntoIterator<Item = &'a Spread>) -> Spread {
        Spread::of(spreads.into_iter().flat_map(|spread| spread.all.iter().copied()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pooled_counts_are_added_and_nothing_has_no_share() {
        let pooled = Ratio::pooled([Ratio::new(1, 2), Ratio::new(0, 6)]);
        assert_eq!((pooled.hits, pooled.of, pooled.value), (1, 8, Some(0.125)));
        assert_eq!(Ratio::counted([true, false, true]), Ratio::new(2, 3));
        assert_eq!(Ratio::counted([]).value, None);
    }

    #[test]
    fn median_and_ninetieth_of_ten() {
        let spread = Spread::of((1..=10).rev().map(f64::from));
        assert_eq!((spread.median, spread.p90, spread.count), (Some(6.0), Some(10.0), 10));
        assert_eq!(Spread::of([]).median, None);
        assert_eq!(Spread::pooled([&Spread::of([1.0]), &Spread::of([3.0, 2.0])]).median, Some(2.0));
    }
}
