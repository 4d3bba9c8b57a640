//! The one error type of the crate.

/// What was wrong with an input, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A list that must hold something holds nothing.
    #[error("{what} is empty: give at least one element")]
    Empty {
        /// Name of the list.
        what: &'static str,
    },
    /// A number is NaN or infinite.
    #[error("{what} {index} is not finite: remove or repair it")]
    NotFinite {
        /// Name of the list or setting.
        what: &'static str,
        /// Index in the list (0 for a single value).
        index: usize,
    },
    /// A number is outside the range in which it means something.
    #[error("{what} = {value} is out of range: it must be {allowed}")]
    OutOfRange {
        /// Name of the value.
        what: &'static str,
        /// The value that was given.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// A list has not as many elements as it must.
    #[error("{found} {what} were given, but {expected} are needed")]
    WrongLength {
        /// Name of the list.
        what: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// Rotors that leave an axis uncontrolled.
    #[error(
        "{rotors} rotors cannot set thrust and three torques one by one: give at least four, of both spins, around the centre"
    )]
    Uncontrollable {
        /// How many rotors there are.
        rotors: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}, but there are only {vertices} vertices")]
    VertexIndex {
        /// Index of the face.
        face: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// Every triangle of a mesh has zero area.
    #[error("all {faces} faces have zero area: nothing can be hit; check the scale and the indices")]
    NoArea {
        /// How many faces were given.
        faces: usize,
    },
    /// More paint than the mass balance can count.
    #[error("the paint would exceed 2^64 femtolitres (18 cubic metres): check the unit of the shot volumes (m^3)")]
    MassOverflow,
    /// Paint is to be taken back that was not deposited.
    #[error(
        "texel {texel} holds less paint than is to be taken back: give the shots, settings and surface of the deposit"
    )]
    NotDeposited {
        /// The texel.
        texel: u32,
    },
    /// A burst that left nothing to measure.
    #[error("burst {burst} left hardly a reading that differs from the bare card: leave it out, or check its card")]
    Unpainted {
        /// Number of the burst, from 0.
        burst: usize,
    },
    /// A burst so thick that its readings do not tell how thick.
    #[error("most painted readings of burst {burst} hide the card: spray shorter, or from farther away")]
    Saturated {
        /// Number of the burst, from 0.
        burst: usize,
    },
    /// Parameters that the data do not tell from one another.
    #[error("the data do not determine {parameters}: hold one of them, or measure what tells them apart")]
    Undetermined {
        /// Their names.
        parameters: String,
    },
    /// A fit that found no minimum.
    #[error("the fit of {what} did not converge: check poses, durations and noise of the data")]
    NoConvergence {
        /// What was sought.
        what: &'static str,
    },
    /// The hose cannot reach the vehicle.
    #[error("a hose of {length:.3} m cannot span {distance:.3} m: lengthen it or move its base")]
    HoseTooShort {
        /// Length of the hose, m.
        length: f64,
        /// Distance from base to vehicle, m.
        distance: f64,
    },
    /// The reference, the controller, the localisation or the pan-tilt unit returned a number that is not finite.
    #[error("{who} returned a value that is not finite at t = {time} s")]
    BadCallback {
        /// Which part.
        who: &'static str,
        /// Time in the flight, s.
        time: f64,
    },
    /// The source of poses gave up, or had none to start with.
    #[error("localisation at t = {time} s: {why}")]
    Localisation {
        /// Time in the flight, s.
        time: f64,
        /// What it said.
        why: String,
    },
    /// There is no GPU that can be used, or it failed.
    #[error("GPU: {what}; the processor does the same without it")]
    Gpu {
        /// What is wrong.
        what: String,
    },
    /// The vehicle ran away from its reference.
    #[error("the flight diverged at t = {time} s ({distance} m from the reference): soften the reference or the wind")]
    Diverged {
        /// Time in the flight, s.
        time: f64,
        /// Distance from the reference, m.
        distance: f64,
    },
}

/// Checks that a single value is finite and lies in `low..=high`.
pub(crate) fn check_range(
    what: &'static str,
    value: f64,
    low: f64,
    high: f64,
    allowed: &'static str,
) -> Result<(), Error> {
    if value.is_finite() && value >= low && value <= high {
        Ok(())
    } else {
        Err(Error::OutOfRange { what, value, allowed })
    }
}

/// Checks that a value is finite and positive.
pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<(), Error> {
    check_range(what, value, f64::MIN_POSITIVE, f64::MAX, "finite and positive")
}

/// Checks that a value is finite and not negative.
pub(crate) fn check_not_negative(what: &'static str, value: f64) -> Result<(), Error> {
    check_range(what, value, 0.0, f64::MAX, "finite and not negative")
}
