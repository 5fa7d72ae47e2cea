//! Generators for the laws of the filter's private parts, and the law of long runs that joins them.

use nalgebra::{Matrix6, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::Stamp;
use crate::odometry::config::LioConfig;
use crate::odometry::degeneracy::Degeneracy;
use crate::odometry::filter::{Belief, standing};
use crate::odometry::propagation::{ImuInput, propagate_covariance, step, symmetric};
use crate::odometry::state::{Covariance, DOF, GRAVITY_MPS2, ImuState, Tangent};
use crate::odometry::update::{PlaneResidual, update};

pub(crate) fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

pub(crate) fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    vector(3.0).prop_map(UnitQuaternion::from_scaled_axis)
}

/// Any state, and any correlations of the size of a tracked state's.
pub(crate) fn belief() -> impl Strategy<Value = Belief> {
    let state = (vector(10.0), rotation(), vector(3.0), vector(0.05), vector(0.3), rotation());
    (state, prop::collection::vec(-1.0..1.0_f64, DOF * DOF)).prop_map(|((p, rotation, v, bg, ba, gravity_frame), m)| {
        let factor = Covariance::from_column_slice(&m) * 0.02;
        Belief {
            state: ImuState {
                stamp: Stamp(7_000_000_000),
                position_m: p,
                rotation,
                velocity_mps: v,
                gyro_bias_radps: bg,
                accel_bias_mps2: ba,
                gravity_frame,
            },
            covariance: symmetric(&(factor * factor.transpose() + Covariance::identity() * 1e-6)),
        }
    })
}

/// The belief in a state that is off by an error.
pub(crate) fn off_by(belief: &Belief, error: &Tangent) -> Belief {
    Belief { state: belief.state.boxplus(error), covariance: belief.covariance }
}

/// A tenth of a second of the filter's life.
#[derive(Debug, Clone)]
struct Tenth {
    rate_radps: Vector3<f64>,
    push_mps2: Vector3<f64>,
    /// A gap or a saturated sample.
    is_doubtful: bool,
    /// Points, raw normals, heights above the planes.
    planes: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
    /// How many axes of translation and of rotation the planes say nothing about.
    held: (usize, usize),
    axes: UnitQuaternion<f64>,
    is_standing: bool,
}

fn tenth() -> impl Strategy<Value = Tenth> {
    let plane = (vector(8.0), vector(1.0), -0.03..0.03_f64);
    let planes = prop_oneof![1 => Just(Vec::new()), 4 => prop::collection::vec(plane, 1..60)];
    let held =
        prop_oneof![3 => Just((0, 0)), 3 => Just((1, 0)), 1 => Just((2, 1)), 1 => Just((3, 0)), 1 => Just((3, 3))];
    (vector(8.0), vector(5.0), prop::bool::weighted(0.05), planes, held, rotation(), prop::bool::weighted(0.2))
        .prop_map(|(rate_radps, push_mps2, is_doubtful, planes, held, axes, is_standing)| Tenth {
            rate_radps,
            push_mps2,
            is_doubtful,
            planes,
            held,
            axes,
            is_standing,
        })
}

/// One scan's worth of the filter, each of its parts in turn. Calls `check` after each.
fn live(belief: &Belief, tenth: &Tenth, mut check: impl FnMut(&'static str, &Belief)) -> Belief {
    let config = LioConfig::default();
    let Belief { mut state, mut covariance } = *belief;
    for _ in 0..20 {
        let until = state.stamp.plus_ns(5_000_000);
        let force_mps2 = tenth.push_mps2 + state.rotation.inverse() * Vector3::z() * GRAVITY_MPS2;
        let input = ImuInput { rate_radps: tenth.rate_radps, force_mps2, is_coasting: false };
        let inflation = if tenth.is_doubtful { 1e4 } else { 1.0 };
        covariance = propagate_covariance(&covariance, &state, &input, until, &config, inflation);
        state = step(&state, &input, until).0;
    }
    let mut belief = Belief { state, covariance };
    check("propagated", &belief);
    let residuals: Vec<PlaneResidual> = tenth
        .planes
        .iter()
        .filter_map(|(point, normal, height_m)| {
            let normal = normal.try_normalize(0.05)?;
            let distance_m = normal.dot(&(state.rotation * point + state.position_m)) - height_m;
            Some(PlaneResidual { point: *point, normal, distance_m, variance_m2: 4e-4 })
        })
        .collect();
    let axes = tenth.axes.to_rotation_matrix().into_inner();
    let first = |count: usize| (0..count).map(|k| axes.column(k).into_owned()).collect();
    let held = Degeneracy { translations: first(tenth.held.0), rotations: first(tenth.held.1), weakest_cells: 0.0 };
    let keep: Matrix6<f64> = held.keep();
    let updated = update(&belief.state, &belief.covariance, &belief.state, &residuals, 4, |_| keep);
    let updated = updated.expect("the covariance of the pose is positive definite");
    belief = Belief { state: updated.state, covariance: updated.covariance };
    check("updated", &belief);
    if tenth.is_standing {
        belief = standing(&belief).expect("the covariance of the velocity is positive definite");
        check("standing", &belief);
    }
    belief
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn covariance_stays_symmetric_and_positive_definite_for_hundreds_of_scans(
        start in belief(), tenths in prop::collection::vec(tenth(), 200..300)
    ) {
        let mut belief = start;
        for (number, tenth) in tenths.iter().enumerate() {
            let mut failure = None;
            belief = live(&belief, tenth, |part, belief| {
                let covariance = &belief.covariance;
                let is_sound = *covariance == covariance.transpose() && covariance.cholesky().is_some();
                if !(is_sound && belief.state.is_finite()) {
                    failure.get_or_insert((part, covariance.symmetric_eigenvalues()));
                }
            });
            prop_assert!(failure.is_none(), "scan {}: {:?}", number, failure);
        }
    }
}
