//! What a painter decided.

use crate::image::Image;
use crate::model::{Saturation, Spray};
use crate::path::Stroke;
use crate::problem::PaintProblem;

/// What a painter decided, and what painters that wrap others add to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Painting {
    /// The sprays in the order in which they are given.
    pub sprays: Vec<Spray>,
    /// Paint depth afterwards, the earlier canvas included.
    pub canvas: Image,
    /// Ink afterwards: `f(canvas)`.
    pub ink: Image,
    /// The parts of a painting in layers or coats, in order; each one's canvas includes the parts before it. Empty for a
    /// painting in one piece.
    pub layers: Vec<Painting>,
    /// The path of the nozzle over the cells, those where the valve is shut (volume 0) included; empty unless the painter
    /// plans one.
    pub waypoints: Vec<Spray>,
    /// The strokes along which the sprays are to be flown; empty unless the painter plans them, as for rows
    /// ([`boustrophedon`](crate::path::boustrophedon)).
    pub strokes: Vec<Stroke>,
    /// Weights of missing ink that the volumes were fitted by, for whoever fits them anew; `None`: those of the problem.
    pub missing_weight: Option<Image>,
    /// Paint that came out over paint that was asked for, as a closed loop estimates it; 1 unless somebody measured.
    pub flow_gain: f64,
}

impl Painting {
    /// A painting in one piece, from its sprays and the depth that they lead to.
    pub fn new(sprays: Vec<Spray>, canvas: Image, saturation: &Saturation) -> Self {
        let ink = canvas.map(|c| saturation.forward(c));
        Self {
            sprays,
            canvas,
            ink,
            layers: Vec::new(),
            waypoints: Vec::new(),
            strokes: Vec::new(),
            missing_weight: None,
            flow_gain: 1.0,
        }
    }

    /// A painting in one piece, rendered: every spray is stamped on the problem's canvas with the problem's kernel.
    pub fn render(problem: &PaintProblem, sprays: Vec<Spray>) -> Self {
        let initial = problem.initial_canvas();
        let mut canvas = initial.clone();
        for spray in &sprays {
            problem.kernel.stamp(spray, &mut canvas);
        }
        problem.settle(initial.data(), canvas.data_mut());
        Self::new(sprays, canvas, problem.saturation)
    }

    /// A painting in layers: all their sprays, and the canvas of the last. `initial`: the canvas if there is no layer.
    pub fn from_layers(layers: Vec<Painting>, initial: Image, saturation: &Saturation) -> Self {
        let sprays = layers.iter().flat_map(|l| l.sprays.iter().copied()).collect();
        let canvas = layers.last().map_or(initial, |l| l.canvas.clone());
        Self { layers, ..Self::new(sprays, canvas, saturation) }
    }

    /// Its layers, or the painting itself if it is in one piece.
    pub fn into_layers(self) -> Vec<Painting> {
        if self.layers.is_empty() { vec![self] } else { self.layers }
    }
}
