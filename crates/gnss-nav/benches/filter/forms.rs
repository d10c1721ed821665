//! Other forms of predict and update, for comparison with those of the library.

use faer::linalg::solvers::SolveCore;
use faer::{Conj, Mat, Side};
use gnss_nav::filter::Covariance;
use gnss_nav::{Measurement, MeasurementModel, NavState};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

type State = SVector<f64, 8>;
type Form = fn(&Problem) -> Option<(State, Covariance)>;

/// Every form by its name.
pub(crate) const ALL: [(&str, Form); 4] = [
    ("general_inverse", general_inverse),
    ("joseph_nalgebra", joseph_nalgebra),
    ("joseph_faer", joseph_faer),
    ("information", information),
];

/// A linear predict and update.
pub(crate) struct Problem {
    prior: Covariance,
    transition: Covariance,
    noise: Covariance,
    rows: Vec<State>,
    residuals: Vec<f64>,
    variances: Vec<f64>,
}

impl Problem {
    pub(crate) fn new(prior: &Covariance, measurements: &[Measurement], at: &NavState) -> Self {
        let mut transition = Covariance::identity();
        for i in 0..4 {
            transition[(2 * i, 2 * i + 1)] = 0.1;
        }
        let model = MeasurementModel::default();
        let mut problem = Self {
            prior: *prior,
            transition,
            noise: Covariance::identity() * 0.01,
            rows: Vec::new(),
            residuals: Vec::new(),
            variances: Vec::new(),
        };
        for m in measurements {
            let e = model
                .predict(&m.state, &at.position_ecef_m, at.time)
                .line_of_sight
                .unit_ecef;
            let (x, y, z) = (-e.x, -e.y, -e.z);
            let code = State::from([x, 0.0, y, 0.0, z, 0.0, 1.0, 0.0]);
            let rate = State::from([0.0, x, 0.0, y, 0.0, z, 0.0, 1.0]);
            problem.rows.extend([code, rate]);
            problem.residuals.extend([1.0, 0.05]);
            let variances = [m.pseudorange_variance_m2, m.range_rate_variance_m2_s2];
            problem.variances.extend(variances);
        }
        problem
    }

    fn predicted(&self) -> Covariance {
        self.transition * self.prior * self.transition.transpose() + self.noise
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn design(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.len(), 8, |i, j| self.rows[i][j])
    }
}

/// Equations (14) to (17) of Jiang2017 as printed: K = P H' (H P H' + R)^-1, P = (I - K H) P.
fn general_inverse(problem: &Problem) -> Option<(State, Covariance)> {
    let p = problem.predicted();
    let h = problem.design();
    let r = DMatrix::from_diagonal(&DVector::from_column_slice(&problem.variances));
    let ph = p * h.transpose();
    let k = &ph * (&h * &ph + r).try_inverse()?;
    let x = &k * DVector::from_column_slice(&problem.residuals);
    let after = (Covariance::identity() - &k * h) * p;
    Some((State::from_column_slice(x.as_slice()), after))
}

/// Joseph's form, gain by nalgebra's Cholesky.
fn joseph_nalgebra(problem: &Problem) -> Option<(State, Covariance)> {
    let p = problem.predicted();
    let h = problem.design();
    let hp = &h * p;
    let mut s = &hp * h.transpose();
    for (i, r) in problem.variances.iter().enumerate() {
        s[(i, i)] += r;
    }
    let gain = s.cholesky()?.solve(&hp);
    let x = gain.tr_mul(&DVector::from_column_slice(&problem.residuals));
    let keep = Covariance::identity() - gain.tr_mul(&h);
    let mut scaled = gain.clone();
    for (mut row, r) in scaled.row_iter_mut().zip(&problem.variances) {
        row *= *r;
    }
    let after = keep * p * keep.transpose() + scaled.tr_mul(&gain);
    Some((State::from_column_slice(x.as_slice()), after))
}

/// Joseph's form, everything that grows with the satellites by faer.
fn joseph_faer(problem: &Problem) -> Option<(State, Covariance)> {
    let p = problem.predicted();
    let m = problem.len();
    let h = Mat::from_fn(m, 8, |i, j| problem.rows[i][j]);
    let hp = &h * Mat::from_fn(8, 8, |i, j| p[(i, j)]);
    let mut s = &hp * h.transpose();
    for (i, r) in problem.variances.iter().enumerate() {
        s[(i, i)] += r;
    }
    let mut gain = hp;
    s.llt(Side::Lower)
        .ok()?
        .solve_in_place_with_conj(Conj::No, gain.as_mut());
    let residuals = Mat::from_fn(m, 1, |i, _| problem.residuals[i]);
    let x = gain.transpose() * residuals;
    let kh = gain.transpose() * h;
    let scaled = Mat::from_fn(m, 8, |i, j| gain[(i, j)] * problem.variances[i]);
    let noise = scaled.transpose() * gain;
    let keep = Covariance::identity() - Covariance::from_fn(|i, j| kh[(i, j)]);
    let after = keep * p * keep.transpose() + Covariance::from_fn(|i, j| noise[(i, j)]);
    Some((State::from_fn(|i, _| x[(i, 0)]), after))
}

/// P = (P^-1 + H' R^-1 H)^-1, x = P H' R^-1 y, by two Cholesky inverses of 8 by 8.
fn information(problem: &Problem) -> Option<(State, Covariance)> {
    let mut information: SMatrix<f64, 8, 8> = problem.predicted().cholesky()?.inverse();
    let mut vector = State::zeros();
    for ((row, y), r) in problem
        .rows
        .iter()
        .zip(&problem.residuals)
        .zip(&problem.variances)
    {
        let weighted = row / *r;
        information += weighted * row.transpose();
        vector += weighted * *y;
    }
    let after = information.cholesky()?.inverse();
    Some((after * vector, after))
}
