//! A figure and what is asked of it.

/// One figure of a report and what is asked of it on the built-in rock.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What was measured.
    pub figure: &'static str,
    /// The number that is checked: SI units, ratios and shares as they are.
    pub value: f64,
    /// How people read the number.
    pub unit: Unit,
    /// What is asked of it.
    pub requirement: Requirement,
    /// What the papers report.
    pub papers: &'static str,
    /// The figure behind the number where that is a ratio or a difference.
    pub detail: Option<String>,
}

/// What is asked of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Requirement {
    /// This or less.
    AtMost(f64),
    /// This or more.
    AtLeast(f64),
    /// Nothing: the figure is for orientation.
    Open,
}

/// How a number is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Metres as centimetres.
    Centimetres,
    /// Seconds as milliseconds.
    Milliseconds,
    /// A share as per cent.
    Percent,
    /// Decibels.
    Decibels,
    /// A multiple.
    Ratio,
    /// A relative error, as a power of ten.
    Relative,
    /// A number without unit.
    Index,
    /// How often.
    Count,
}

impl Unit {
    /// The number with its unit.
    pub fn show(self, value: f64) -> String {
        match self {
            Self::Centimetres => format!("{:.2} cm", 100.0 * value),
            Self::Milliseconds => format!("{:.2} ms", 1e3 * value),
            Self::Percent => format!("{:.1} %", 100.0 * value),
            Self::Decibels => format!("{value:.2} dB"),
            Self::Ratio => format!("{value:.2}x"),
            Self::Relative => format!("{value:.1e}"),
            Self::Index => format!("{value:.3}"),
            Self::Count => format!("{value:.0}"),
        }
    }
}

impl Check {
    /// Whether the figure is what is asked for; a NaN never is.
    pub fn holds(&self) -> bool {
        match self.requirement {
            Requirement::AtMost(limit) => self.value <= limit,
            Requirement::AtLeast(limit) => self.value >= limit,
            Requirement::Open => true,
        }
    }

    /// How far inside its limit the figure is; negative outside, infinite where nothing is asked.
    pub fn margin(&self) -> f64 {
        match self.requirement {
            Requirement::AtMost(limit) => limit - self.value,
            Requirement::AtLeast(limit) => self.value - limit,
            Requirement::Open => f64::INFINITY,
        }
    }

    /// The value for people.
    pub fn value_text(&self) -> String {
        let value = self.unit.show(self.value);
        self.detail.as_ref().map_or(value.clone(), |detail| format!("{value} ({detail})"))
    }

    /// What is asked, for people.
    pub fn requirement_text(&self) -> String {
        match self.requirement {
            Requirement::AtMost(limit) => format!("≤ {}", self.unit.show(limit)),
            Requirement::AtLeast(limit) => format!("≥ {}", self.unit.show(limit)),
            Requirement::Open => "-".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(value: f64, requirement: Requirement) -> Check {
        Check { figure: "", value, unit: Unit::Centimetres, requirement, papers: "-", detail: None }
    }

    #[test]
    fn a_limit_includes_itself_and_nan_never_holds() {
        for (value, requirement, holds) in [
            (0.015, Requirement::AtMost(0.015), true),
            (0.0151, Requirement::AtMost(0.015), false),
            (5.0, Requirement::AtLeast(5.0), true),
            (4.99, Requirement::AtLeast(5.0), false),
            (1e9, Requirement::Open, true),
            (f64::NAN, Requirement::AtMost(1.0), false),
            (f64::NAN, Requirement::AtLeast(1.0), false),
        ] {
            let check = check(value, requirement);
            assert_eq!(check.holds(), holds, "{check:?}");
            assert_eq!(check.margin() >= 0.0, holds, "{check:?}");
        }
    }

    #[test]
    fn people_read_centimetres() {
        let plain = check(0.0123, Requirement::AtMost(0.015));
        assert_eq!((plain.value_text(), plain.requirement_text()), ("1.23 cm".into(), "≤ 1.50 cm".into()));
        let ratio =
            Check { unit: Unit::Ratio, detail: Some("4.50 cm".into()), ..check(11.25, Requirement::AtLeast(5.0)) };
        assert_eq!((ratio.value_text(), ratio.requirement_text()), ("11.25x (4.50 cm)".into(), "≥ 5.00x".into()));
    }
}
