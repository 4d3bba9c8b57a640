//! Numbers above zero on the command line.

pub(super) fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| "give a positive number".to_owned())
}
