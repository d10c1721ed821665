//! Order statistics.

/// Median, or the mean of the middle two; NaN of none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let sorted = sorted(values);
    let middle = |k: usize| sorted.get(k).copied().unwrap_or(f64::NAN);
    let half = sorted.len() / 2;
    if sorted.len() % 2 == 1 {
        middle(half)
    } else {
        f64::midpoint(middle(half.wrapping_sub(1)), middle(half))
    }
}

/// Smallest value that a `part` of `values` do not exceed; NaN of none.
pub fn quantile(values: impl IntoIterator<Item = f64>, part: f64) -> f64 {
    let sorted = sorted(values);
    // A part that is a whole number of values may round up.
    let rank = (part * sorted.len() as f64 - 1e-9).ceil().max(1.0) as usize;
    sorted.get(rank - 1).copied().unwrap_or(f64::NAN)
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.into_iter().collect();
    all.sort_by(f64::total_cmp);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_values_or_between_two() {
        let values = || (1..=20).rev().map(f64::from);
        assert_eq!(quantile(values(), 0.95), 19.0);
        assert_eq!(quantile(values(), 0.0), 1.0);
        assert_eq!(quantile(values(), 1.0), 20.0);
        assert_eq!(median(values()), 10.5);
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), 2.5);
    }

    #[test]
    fn of_none_there_is_none() {
        assert!(median([]).is_nan());
        assert!(quantile([], 0.5).is_nan());
    }
}
