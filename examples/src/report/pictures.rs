//! The pictures in a report.

/// File names and captions, in their order; those that are not there are left out.
pub(super) const PICTURES: [(&str, &str); 9] = [
    ("painted_view.png", "The painted surface as a camera sees it"),
    ("views.png", "From the left, the front and the right, from near and far"),
    ("turntable.png", "From around"),
    ("wanted.png", "Wanted"),
    ("painted.png", "Painted"),
    ("sagging.png", "Where the paint was so thick that it ran: red"),
    ("error.png", "Difference"),
    ("path.png", "Flown path, of the base coat if there are layers: vehicle orange, nozzle blue"),
    ("angles.png", "Pan, tilt, distance and normal deviation over time"),
];
