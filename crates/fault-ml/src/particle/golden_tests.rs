//! Likelihood averages and one run of the swarm against the reference figures.

use serde_json::Value;

use super::cloud::Cloud;
use super::evidence::Evidence;
use super::quadratic::Quadratic;
use super::swarm::{Swarm, SwarmSettings};
use super::*;
use crate::golden::{assert_close, matrix, numbers, rows, text};
use crate::{STATES, Sight};

/// The fixed particles and measurements.
fn golden() -> Option<(Value, Vec<Sight>, Cloud)> {
    let golden: Value = serde_json::from_str(&text("golden.json")?).unwrap();
    let residuals = numbers(&golden, "/pf_in/y");
    let sigma_m = golden["pf_in"]["sigma"].as_f64().unwrap();
    let rows = matrix(&golden, "/pf_in/H").into_iter().zip(residuals);
    let sight = |(id, (design, residual_m)): (u32, (Vec<f64>, f64))| Sight {
        id,
        design: design.try_into().unwrap(),
        residual_m,
        sigma_m,
    };
    let sights = (0..).zip(rows).map(sight).collect();
    let mut cloud = Cloud::new(50);
    for (i, particle) in matrix(&golden, "/pf_in/X").iter().enumerate() {
        for (d, coordinate) in particle.iter().enumerate() {
            cloud.state[d][i] = *coordinate;
        }
    }
    cloud.weight = numbers(&golden, "/pf_in/w");
    Some((golden, sights, cloud))
}

/// The unweighted and weighted means, the mean logarithm, and the logarithm at the mean particle.
fn averages(cloud: &Cloud, evidence: &Evidence, plug: f64) -> [f64; 4] {
    let mut equal = cloud.clone();
    equal.weight.fill(1.0 / cloud.len() as f64);
    let total = evidence.total();
    [
        evidence.log_mean(&equal),
        evidence.log_mean(cloud),
        total.iter().sum::<f64>() / total.len() as f64,
        plug,
    ]
}

#[test]
fn likelihood_averages_are_the_reference() {
    let Some((golden, sights, cloud)) = golden() else {
        return;
    };
    let cases = [
        ("pf_gauss", Likelihood::Gaussian),
        ("pf_mix", Likelihood::HEAVY_TAILED),
    ];
    for (key, likelihood) in cases {
        let mut evidence = Evidence::new(50);
        for left_out in std::iter::once(None).chain((0..9).map(Some)) {
            evidence.fill(&cloud.state, &sights, left_out, &likelihood);
            let mean = cloud.mean();
            let used = sights
                .iter()
                .enumerate()
                .filter(|(s, _)| Some(*s) != left_out);
            let plug = used
                .map(|(_, s)| likelihood.log_density(s.residual_about(&mean), s.sigma_m))
                .sum();
            let expected = left_out.map_or_else(
                || numbers(&golden, &format!("/{key}/all9")),
                |q| numbers(&golden, &format!("/{key}/excl/{q}")),
            );
            let found = averages(&cloud, &evidence, plug);
            for (form, (found, expected)) in found.into_iter().zip(expected).enumerate() {
                assert_close(
                    found,
                    expected,
                    &format!("{key}, {left_out:?}, form {form}"),
                );
            }
        }
        evidence.fill(&cloud.state, &sights, None, &likelihood);
        let mut weighed = cloud.clone();
        weighed.reweigh(evidence.total());
        let effective = golden[key]["neff_main"].as_f64().unwrap();
        assert_close(weighed.effective(), effective, key);
        let expected = numbers(&golden, &format!("/{key}/est_main"));
        for (found, expected) in weighed.mean().into_iter().zip(expected) {
            assert_close(found, expected, key);
        }
    }
}

#[test]
fn the_swarm_with_given_random_numbers_is_the_reference() {
    let Some((golden, sights, cloud)) = golden() else {
        return;
    };
    let given = ["golden_pso_r1.csv", "golden_pso_r2.csv"].map(rows);
    let [Some(r1), Some(r2)] = given else { return };
    let settings = SwarmSettings {
        inertia: 0.729,
        attraction: 1.494,
        ..SwarmSettings::default()
    };
    let form = Quadratic::fitness(sights.iter());
    let (mut swarm, mut state) = (Swarm::new(50), cloud.state);
    let mut iteration = 0;
    let draw = |uniform: &mut [f64]| {
        for d in 0..STATES {
            for i in 0..50 {
                uniform[2 * d * 50 + i] = r1[50 * iteration + i][d];
                uniform[(2 * d + 1) * 50 + i] = r2[50 * iteration + i][d];
            }
        }
        iteration += 1;
    };
    swarm.run(
        &mut state,
        &settings,
        |state, f| form.evaluate(state, f),
        draw,
    );
    let best = golden["pso"]["gbest_fit"].as_f64().unwrap();
    assert_close(swarm.leader_fitness(), best, "best fitness");
    for (d, expected) in numbers(&golden, "/pso/gbest").into_iter().enumerate() {
        assert_close(swarm.leader()[d], expected, "best place");
    }
    for (i, particle) in matrix(&golden, "/pso/x_end_first5").iter().enumerate() {
        for (d, expected) in particle.iter().enumerate() {
            assert_close(state[d][i], *expected, "particle at the end");
        }
    }
    for (d, expected) in numbers(&golden, "/pso/x_end_mean").into_iter().enumerate() {
        assert_close(
            state[d].iter().sum::<f64>() / 50.0,
            expected,
            "mean at the end",
        );
    }
}
