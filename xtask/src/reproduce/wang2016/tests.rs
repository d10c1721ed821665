//! The reproduction with a few seeds; all of them are the command's.

use super::checks::{PAPER_ALARM_S, alarm_s, effective};
use super::detector::Kind;
use super::performance::Performance;
use super::setting::{TrueNoise, Truth, geometry};
use super::simulate::{Campaign, Run};
use super::study::{SWARM, bootstrap, swarmed};
use fault_ml::particle::ParticleParameters;

fn campaign(parameters: ParticleParameters) -> Campaign {
    Campaign {
        truth: Truth {
            noise: TrueNoise::Mixture,
            sigma_m: 1.8,
        },
        sigma_m: 3.0,
        kind: Kind::Particle(parameters),
    }
}

fn runs(parameters: ParticleParameters) -> Vec<Run> {
    campaign(parameters)
        .runs(&geometry().unwrap(), 0..6)
        .unwrap()
}

#[test]
fn six_seeds_come_near_the_tables_of_the_paper() {
    let (pf, pso) = (runs(bootstrap()), runs(swarmed(SWARM)));
    for (runs, paper) in [(&pf, PAPER_ALARM_S[0]), (&pso, PAPER_ALARM_S[1])] {
        for (ours, paper) in alarm_s(runs).into_iter().zip(paper) {
            // 200 seeds come within 2 s; single alarms scatter by 1.5 s, medians of six by 0.8 s.
            assert!((ours - paper).abs() <= 4.0, "{ours} for {paper}");
        }
        let sound = Performance::new(runs, 1, 20.0);
        assert_eq!((sound.false_alarm_runs, sound.identified), (0.0, [1.0; 3]));
        assert!(sound.delay_median_s[0] <= 4.0, "{sound:?}");
    }
    assert!(
        effective(&pf)
            .iter()
            .zip(effective(&pso))
            .all(|(pf, pso)| *pf < pso)
    );
}

#[test]
fn a_run_depends_on_its_seed_alone() {
    let campaign = campaign(bootstrap());
    let geometry = geometry().unwrap();
    let both = campaign.runs(&geometry, 3..5).unwrap();
    let second = campaign.runs(&geometry, 4..5).unwrap();
    assert_eq!(both[1..], second[..]);
    assert_ne!(both[0], both[1]);
}
