//! The program of one state, five variables and a handful of rows, by the dual active-set method of Goldfarb and Idnani (1983).
//!
//! A soft row is one whose multiplier may not exceed the penalty: where it gets there, the row is given up and its force stays. Nothing is
//! allocated; matrices are arrays of five, columns first.

use nalgebra::{Matrix5, Vector5};

/// Variables of a state.
const N: usize = 5;
/// Rows are broken by more than this before they count as broken, relative to the size of their terms.
const BROKEN: f64 = 1e-13;
/// Squared length of the direction that the rows held leave, below which they leave none.
const NONE_LEFT: f64 = 1e-24;

type Vector = [f64; N];

/// One row `a . x <= b`; `limit` is the greatest multiplier, infinite for a hard row.
#[derive(Debug, Clone, Copy)]
pub(super) struct StateRow {
    pub(super) a: Vector,
    pub(super) b: f64,
    pub(super) limit: f64,
}

/// Rows that hold the state, with the factors of their normals in the metric of the Hessian.
struct Held {
    /// Rows in the order in which they were taken in, and from which side: the multiplier counts from 0 or from the limit.
    rows: [usize; N],
    sign: Vector,
    multiplier: Vector,
    count: usize,
    /// `J` with `J' H J = 1`; the first `count` columns span the normals.
    j: [Vector; N],
    /// Upper triangle, columns first: `J' normals`.
    r: [Vector; N],
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + a[4] * b[4]
}

/// Minimises `1/2 x'Hx + g'x` under the rows. Returns the minimum, or `None` where `H` is not positive definite, the hard rows admit no point,
/// or the steps run out. `given_up` is room for one flag per row.
pub(super) fn minimise(
    hessian: &Matrix5<f64>,
    gradient: &Vector5<f64>,
    rows: &[StateRow],
    given_up: &mut [bool],
) -> Option<Vector5<f64>> {
    let j = inverse_root(hessian)?;
    let mut held = Held { rows: [usize::MAX; N], sign: [0.0; N], multiplier: [0.0; N], count: 0, j, r: [[0.0; N]; N] };
    let g: Vector = (*gradient).into();
    let mut x = [0.0; N];
    for column in &held.j {
        let share = dot(column, &g);
        (0..N).for_each(|k| x[k] -= column[k] * share);
    }
    given_up.fill(false);
    for _ in 0..(8 * (rows.len() + N)) {
        let Some((row, sign)) = most_broken(&x, rows, given_up, &held) else { return Some(x.into()) };
        held.take_in(row, sign, &mut x, rows, given_up)?;
    }
    None
}

/// The columns of `L^-T` for `H = L L'`.
fn inverse_root(hessian: &Matrix5<f64>) -> Option<[Vector; N]> {
    let mut l = [[0.0; N]; N];
    for c in 0..N {
        for r in c..N {
            let mut value = hessian[(r, c)];
            for column in &l[..c] {
                value -= column[r] * column[c];
            }
            if r > c {
                l[c][r] = value * l[c][c];
            } else if value > 0.0 && value.is_finite() {
                // The diagonal is kept inverted.
                l[c][c] = 1.0 / value.sqrt();
            } else {
                return None;
            }
        }
    }
    // Row r of L^-1 is column r of L^-T.
    let mut j = [[0.0; N]; N];
    for c in 0..N {
        j[c][c] = l[c][c];
        for r in c + 1..N {
            let mut value = 0.0;
            for k in c..r {
                value -= l[k][r] * j[k][c];
            }
            j[r][c] = value * l[r][r];
        }
    }
    Some(j)
}

/// The row that is broken most, and whether its multiplier has to rise (1) or, where it was given up, to fall (-1).
fn most_broken(x: &Vector, rows: &[StateRow], given_up: &[bool], held: &Held) -> Option<(usize, f64)> {
    let (mut most, mut found) = (0.0, None);
    for (k, (row, &given_up)) in rows.iter().zip(given_up).enumerate() {
        let excess = dot(&row.a, x) - row.b;
        let (excess, sign) = if given_up { (-excess, -1.0) } else { (excess, 1.0) };
        if excess > most && excess > BROKEN * (1.0 + row.b.abs()) && !held.rows[..held.count].contains(&k) {
            (most, found) = (excess, Some((k, sign)));
        }
    }
    found
}

impl Held {
    /// Raises the multiplier of a broken row until it holds, is given up, or pushes others out. `None`: no point satisfies it.
    fn take_in(
        &mut self,
        row: usize,
        sign: f64,
        x: &mut Vector,
        rows: &[StateRow],
        given_up: &mut [bool],
    ) -> Option<()> {
        let StateRow { a, b, limit } = rows[row];
        let normal = a.map(|a| sign * a);
        let mut multiplier = 0.0;
        loop {
            let d: Vector = std::array::from_fn(|k| dot(&self.j[k], &normal));
            // How the multipliers of the rows held change with this one, and the way that x goes.
            let mut change = [0.0; N];
            for k in (0..self.count).rev() {
                let mut value = d[k];
                for (column, change) in self.r[..self.count].iter().zip(&change).skip(k + 1) {
                    value -= column[k] * change;
                }
                change[k] = value / self.r[k][k];
            }
            let mut way = [0.0; N];
            let mut free = 0.0;
            for (column, d) in self.j.iter().zip(&d).skip(self.count) {
                (0..N).for_each(|c| way[c] -= column[c] * d);
                free += d * d;
            }
            let excess = dot(&normal, x) - sign * b;
            let until_held = if free > NONE_LEFT { excess / free } else { f64::INFINITY };
            let (mut step, mut out) = (until_held.min(limit - multiplier), None);
            for k in 0..self.count {
                let room = if change[k] > 0.0 {
                    self.multiplier[k] / change[k]
                } else if change[k] < 0.0 {
                    (self.multiplier[k] - rows[self.rows[k]].limit) / change[k]
                } else {
                    f64::INFINITY
                };
                if room < step {
                    (step, out) = (room, Some(k));
                }
            }
            if step.is_infinite() {
                return None;
            }
            (0..N).for_each(|c| x[c] += step * way[c]);
            (0..self.count).for_each(|k| self.multiplier[k] -= step * change[k]);
            multiplier += step;
            match out {
                Some(k) => {
                    // Out at the limit the force of the row stays, whichever side it was counted from.
                    if change[k] < 0.0 {
                        given_up[self.rows[k]] = self.sign[k] > 0.0;
                    } else {
                        given_up[self.rows[k]] = self.sign[k] < 0.0;
                    }
                    self.drop(k);
                }
                None if step == until_held => {
                    self.add(row, sign, multiplier, d);
                    return Some(());
                }
                None => {
                    given_up[row] = sign > 0.0;
                    return Some(());
                }
            }
        }
    }

    /// Takes a row in, `d` being its normal in the columns of `J`: turns the free columns so that it needs one of them only.
    fn add(&mut self, row: usize, sign: f64, multiplier: f64, mut d: Vector) {
        for k in (self.count + 1..N).rev() {
            let (cos, sin, length) = rotation(d[k - 1], d[k]);
            (d[k - 1], d[k]) = (length, 0.0);
            self.turn(k - 1, cos, sin);
        }
        let place = self.count;
        self.r[place] = d;
        (self.rows[place], self.sign[place], self.multiplier[place]) = (row, sign, multiplier);
        self.count += 1;
    }

    /// Lets go of the row at a place, and makes `R` a triangle again.
    fn drop(&mut self, place: usize) {
        self.count -= 1;
        for k in place..self.count {
            self.rows[k] = self.rows[k + 1];
            self.sign[k] = self.sign[k + 1];
            self.multiplier[k] = self.multiplier[k + 1];
            self.r[k] = self.r[k + 1];
        }
        for k in place..self.count {
            let (cos, sin, _) = rotation(self.r[k][k], self.r[k][k + 1]);
            for column in &mut self.r[k..self.count] {
                let (a, b) = (column[k], column[k + 1]);
                (column[k], column[k + 1]) = (cos * a + sin * b, cos * b - sin * a);
            }
            self.turn(k, cos, sin);
        }
    }

    /// Turns columns `k` and `k + 1` of `J`.
    fn turn(&mut self, k: usize, cos: f64, sin: f64) {
        for c in 0..N {
            let (a, b) = (self.j[k][c], self.j[k + 1][c]);
            (self.j[k][c], self.j[k + 1][c]) = (cos * a + sin * b, cos * b - sin * a);
        }
    }
}

/// The rotation that puts (a, b) on the first axis: cosine, sine, length.
fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    let length = (a * a + b * b).sqrt();
    if length > 0.0 { (a / length, b / length, length) } else { (1.0, 0.0, 0.0) }
}
