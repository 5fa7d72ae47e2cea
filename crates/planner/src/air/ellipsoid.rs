//! The largest ellipsoid inside a polytope, as a second-order cone program (clarabel).
//!
//! ```text
//! ellipsoid { c + L u : |u| <= 1 },  L lower triangular
//! max t  such that  |L^T n_i| <= d_i - n_i . c                      every face
//!                   t1^2 <= L00 L11,  t2^2 <= L22 t,  t^2 <= t1 t2   so that t^3 <= det L
//! ```

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{Matrix3, Vector3};

use super::polytope::Polytope;

/// An ellipsoid `centre + shape u`, `|u| <= 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Its centre.
    pub centre: Vector3<f64>,
    /// Lower triangular; the product of its diagonal is volume / (4 pi / 3).
    pub shape: Matrix3<f64>,
}

impl Ellipsoid {
    /// Its volume (m^3).
    pub fn volume(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.shape.diagonal().product()
    }
}

/// Interior-point iterations at most; it takes about twelve.
const MAX_ITERATIONS: u32 = 60;
/// Variables: centre, the six of L by rows, t1, t2, t.
const COUNT: usize = 12;

/// The ellipsoid of the largest volume inside. `None` if the polytope has no inside, is unbounded, or holds numbers that are not
/// finite.
pub fn inscribed_ellipsoid(polytope: &Polytope) -> Option<Ellipsoid> {
    // Work near the origin, at the size of the polytope, so that the tolerances of the solver mean the same everywhere.
    let (origin, depth_m) = super::depth::deepest_point(polytope.faces.iter(), &Vector3::zeros())?;
    if !(1e-9..1e3).contains(&depth_m) {
        return None;
    }
    let l = |row: usize, column: usize| 3 + row * (row + 1) / 2 + column;
    let (t1, t2, t) = (9, 10, 11);
    // Rows of A x + s = b, s in the cones, listed by column.
    let mut columns: Vec<Vec<(usize, f64)>> = vec![Vec::new(); COUNT];
    let mut b = Vec::new();
    let mut cones = Vec::new();
    for face in &polytope.faces {
        let n = &face.normal;
        let row = b.len();
        // s0 = d - n . c;  s_k = (L^T n)_k = sum_r L_rk n_r.
        for axis in 0..3 {
            columns[axis].push((row, n[axis]));
        }
        for k in 0..3 {
            for r in k..3 {
                columns[l(r, k)].push((row + 1 + k, -n[r]));
            }
        }
        b.extend([(face.offset_m - n.dot(&origin)) / depth_m, 0.0, 0.0, 0.0]);
        cones.push(SupportedConeT::SecondOrderConeT(4));
    }
    // z^2 <= x y is |(2 z, x - y)| <= x + y.
    for (z, x, y) in [(t1, l(0, 0), l(1, 1)), (t2, l(2, 2), t), (t, t1, t2)] {
        let row = b.len();
        columns[x].extend([(row, -1.0), (row + 2, -1.0)]);
        columns[y].extend([(row, -1.0), (row + 2, 1.0)]);
        columns[z].push((row + 1, -2.0));
        b.extend([0.0; 3]);
        cones.push(SupportedConeT::SecondOrderConeT(3));
    }
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for mut column in columns {
        column.sort_by_key(|(row, _)| *row);
        for (row, value) in column {
            rows.push(row);
            values.push(value);
        }
        starts.push(rows.len());
    }
    let a = CscMatrix::new(b.len(), COUNT, starts, rows, values);
    let p = CscMatrix::zeros((COUNT, COUNT));
    let mut q = vec![0.0; COUNT];
    q[t] = -1.0;
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(MAX_ITERATIONS).build().ok()?;
    let mut solver = DefaultSolver::<f64>::new(&p, &q, &a, &b, &cones, settings).ok()?;
    solver.solve();
    if !matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return None;
    }
    let x = &solver.solution.x;
    let mut shape = Matrix3::zeros();
    for row in 0..3 {
        for column in 0..=row {
            shape[(row, column)] = x[l(row, column)] * depth_m;
        }
    }
    Some(Ellipsoid { centre: origin + Vector3::new(x[0], x[1], x[2]) * depth_m, shape })
}
