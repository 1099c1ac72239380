//! Root finding by bisection.

/// Returns the place between `a` and `b` where `holds` changes its value, to the last bit. It must change
/// once. Halving is slow, but always ends.
pub(crate) fn bisect(mut a: f64, mut b: f64, mut holds: impl FnMut(f64) -> bool) -> f64 {
    let first = holds(a);
    loop {
        let middle = 0.5 * (a + b);
        if middle <= a || middle >= b {
            return b;
        }
        if holds(middle) == first {
            a = middle
        } else {
            b = middle
        }
    }
}
