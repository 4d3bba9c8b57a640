//! A wall of one's own, sprayed and measured: what a closed loop asks of whoever watches the paint.

use paint_net::painters::{ClosedLoopPainter, LayerPlanning, Layered, SlewLimited};
use paint_net::procedural::Texture;
use paint_net::{Error, Image, Observer, PaintProblem, Painter, Spray};

use crate::own_painter::{Halftone, psnr};

/// A nozzle that gives four fifths of what it is asked for.
struct WeakNozzle<'a> {
    problem: PaintProblem<'a>,
    canvas: Image,
}

impl Observer for WeakNozzle<'_> {
    fn spray(&mut self, sprays: &[Spray]) -> Result<Option<Image>, Error> {
        for s in sprays {
            self.problem.kernel.stamp(&Spray { volume: 0.8 * s.volume, ..*s }, &mut self.canvas);
        }
        Ok(Some(self.canvas.map(|c| self.problem.saturation.forward(c))))
    }
}

#[test]
fn a_closed_loop_around_it_finds_the_gain_and_paints_better() {
    let wanted = Texture::Fbm.image(3, 64);
    let problem = PaintProblem::new(&wanted);
    let bare = problem.initial_canvas();
    let open = {
        let mut nozzle = WeakNozzle { problem, canvas: bare.clone() };
        let ink = nozzle.spray(&Halftone.paint(&problem).unwrap().sprays).unwrap().unwrap();
        psnr(&ink, &wanted)
    };
    let mut nozzle = WeakNozzle { problem, canvas: bare };
    let painting = ClosedLoopPainter::new(Halftone).paint_observed(&problem, &mut nozzle).unwrap();
    assert!((painting.flow_gain - 0.8).abs() < 1e-6, "{}", painting.flow_gain);
    assert_eq!(painting.layers.len(), 3);
    let closed = psnr(&painting.ink, &wanted);
    assert!(closed > open + 1.0, "{closed} dB closed, {open} dB open");
    assert!((closed - psnr(&nozzle.canvas.map(f64::tanh), &wanted)).abs() < 1e-6);
}

#[test]
fn a_layer_is_sprayed_before_the_next_is_planned() {
    // Layers one after the other, each in a closed loop: the observer of the whole sees the sprays of every coat.
    let wanted = Texture::Fbm.image(9, 40);
    let problem = PaintProblem::new(&wanted);
    let mut nozzle = WeakNozzle { problem, canvas: problem.initial_canvas() };
    let painter = Layered { planning: LayerPlanning::Sequential, ..Layered::new(ClosedLoopPainter::new(Halftone)) };
    let painting = painter.paint_observed(&problem, &mut nozzle).unwrap();
    for (painted, wall) in painting.canvas.data().iter().zip(nozzle.canvas.data()) {
        assert!((painted - wall).abs() < 1e-6 || *wall > 2.9, "{painted} {wall}");
    }
    // A painter that changes the plan afterwards must not have it sprayed.
    let mut untouched = WeakNozzle { problem, canvas: problem.initial_canvas() };
    SlewLimited::new(ClosedLoopPainter::new(Halftone), 0.1).paint_observed(&problem, &mut untouched).unwrap();
    assert_eq!(untouched.canvas, problem.initial_canvas());
}
