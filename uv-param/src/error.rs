//! What can be wrong with an input, and the way out.

/// Everything this crate refuses. Vertex and face indices are those of the caller's mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No vertices or no faces were given.
    #[error("the mesh has no faces; give at least one triangle")]
    Empty,
    /// A vertex that some face uses is not finite, or so far away (1e40) that areas would not be.
    #[error("vertex {vertex} has a NaN, infinite or absurdly large coordinate; remove it and the faces that use it")]
    NonFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but there are only {vertices} vertices (counted from 0)")]
    IndexOutOfRange {
        /// Index of the face.
        face: usize,
        /// The offending vertex index.
        index: u32,
        /// Number of vertices given.
        vertices: usize,
    },
    /// Vertex or face indices would not fit into the 32 bits they are kept in.
    #[error("the mesh has {count} vertices or faces; at most {limit} can be unwrapped at once, simplify or split it")]
    TooLarge {
        /// Number given.
        count: usize,
        /// Largest number accepted.
        limit: usize,
    },
    /// A mesh far from the origin of its coordinates was stored with too few digits.
    #[error(
        "coordinates reach {coordinate:.4e}, but come in steps of {step:.3} where edges are {edge:.3} long: the relief is lost in the file; \
         export it in double precision, or moved to the origin"
    )]
    LostRelief {
        /// Largest coordinate, units of the file.
        coordinate: f64,
        /// Their step.
        step: f64,
        /// Median length of an edge.
        edge: f64,
    },
    /// All faces are degenerate.
    #[error("all faces have zero area or are repeated; check the units and the export of the mesh")]
    ZeroArea,
    /// Three or more faces share an edge.
    #[error("edge {a}-{b} is shared by {faces} faces; split the mesh there so that each edge has one or two faces")]
    NonManifoldEdge {
        /// One end.
        a: u32,
        /// The other end.
        b: u32,
        /// How many faces share it.
        faces: usize,
    },
    /// The faces around a vertex form more than one fan.
    #[error(
        "vertex {vertex} joins parts of the surface that share no edge; set Repair::split_vertices or duplicate it"
    )]
    NonManifoldVertex {
        /// Index of the vertex.
        vertex: u32,
    },
    /// The surface is one-sided.
    #[error("the surface is one-sided (like a Moebius strip) near face {face}; cut it open before unwrapping")]
    NotOrientable {
        /// A face at which two orientations met.
        face: u32,
    },
    /// The surface has no boundary.
    #[error("the surface is closed (genus {genus}); cut it open along edges so that it has a boundary")]
    Closed {
        /// Number of handles.
        genus: usize,
    },
    /// The surface has handles.
    #[error("the surface has {genus} handle(s) and {boundary_loops} boundary loop(s); cut the handles open first")]
    HigherGenus {
        /// Number of handles.
        genus: usize,
        /// Number of boundary loops.
        boundary_loops: usize,
    },
    /// A path along which the surface cannot be cut.
    #[error("the surface cannot be cut along this path: {problem} (path[{index}])")]
    Cut {
        /// Index into the path.
        index: usize,
        /// What is wrong there and what would be right.
        problem: &'static str,
    },
    /// A seam that the caller wants runs along no edge.
    #[error("seam {index} ({}-{}) is no edge of the mesh; list pairs of neighbouring vertices", edge[0], edge[1])]
    Seam {
        /// Index into the list of seams.
        index: usize,
        /// The two vertices.
        edge: [u32; 2],
    },
    /// The flip-free minimiser needs an injective start, and rounding destroyed it.
    #[error("{faces} triangles collapse in the start layout (a long tube?); cut the surface open along the tube")]
    CollapsedStart {
        /// Triangles that are not strictly positive.
        faces: usize,
    },
    /// The linear system of the layout could not be factorised.
    #[error("the layout's linear system is numerically singular; remove needle-like triangles or remesh")]
    Singular,
    /// A setting is out of its range.
    #[error("{name} = {value} is out of range: it must be {must_be}")]
    Setting {
        /// Name of the field or argument.
        name: &'static str,
        /// Value given.
        value: f64,
        /// What is accepted.
        must_be: &'static str,
    },
    /// The texture would be unreasonably large.
    #[error("a texel of {texel_m} m gives {width} x {height} texels, more than {limit}; use a larger texel")]
    TooManyTexels {
        /// Texel side, metres.
        texel_m: f64,
        /// Columns needed.
        width: f64,
        /// Rows needed.
        height: f64,
        /// Largest product accepted.
        limit: usize,
    },
    /// Faces of an atlas that have no area on their page, whose coordinates are too coarse for them.
    #[error(
        "{faces} triangles are so small beside their page that double precision flattens them; lay parts of such different sizes out one by one"
    )]
    CollapsedOnPage {
        /// Triangles that are not strictly counter-clockwise there.
        faces: usize,
    },
    /// A slice has the wrong length.
    #[error("{what}: {found} given, {expected} expected (one per vertex or face of the mesh handed in)")]
    Length {
        /// Which slice.
        what: &'static str,
        /// Length expected.
        expected: usize,
        /// Length found.
        found: usize,
    },
    /// A value of a slice is not finite.
    #[error("{what}[{index}] is NaN or infinite")]
    NonFiniteValue {
        /// Which slice.
        what: &'static str,
        /// Index into it.
        index: usize,
    },
    /// Fewer than three points, or all on one line.
    #[error("a minimal rectangle needs three points that are not on one line; {points} given")]
    FlatPoints {
        /// Number of points given.
        points: usize,
    },
    /// A point of the plane that no triangle covers.
    #[error("the point ({u}, {v}) m lies outside the chart; keep commands on the covered texels")]
    OutsideChart {
        /// Horizontal coordinate, metres.
        u: f64,
        /// Vertical coordinate, metres.
        v: f64,
    },
}
