//! A channel on an ideal signal in noise.

use super::super::loop_filter::CarrierBandwidth;
use super::super::simulated::IdealSignal;
use super::*;
use crate::CorrelatorBank;

struct Run {
    channel: Channel,
    noise: NoiseFloor,
    bits: Vec<NavBit>,
}

impl Run {
    fn new(signal: &IdealSignal, code_error: f64, doppler_error: f64) -> Self {
        let hit = signal.hit(code_error, doppler_error);
        let settings = TrackingSettings::default();
        let unused = SignalId::gps_l1_ca(37).unwrap();
        Self {
            channel: Channel::new(&hit, signal.front_end, settings),
            noise: NoiseFloor::new(unused, signal.front_end).unwrap(),
            bits: Vec::new(),
        }
    }

    /// Tracks up to `time_s` and returns the epoch there.
    fn to(&mut self, signal: &mut IdealSignal, time_s: f64) -> Option<ChannelEpoch> {
        let tick = (time_s * signal.front_end.sample_rate_hz).round() as u64;
        let mut taps = Vec::new();
        while let Some(replica) = self.channel.replica().filter(|r| r.end_tick <= tick) {
            signal.correlate(&[replica], &mut taps).unwrap();
            let update = self.channel.update(&replica, &taps[0], &self.noise);
            self.bits.extend(update.bit);
        }
        self.channel.epoch(tick)
    }
}

fn code_error(signal: &IdealSignal, epoch: &ChannelEpoch) -> f64 {
    let t = epoch.tick as f64 / signal.front_end.sample_rate_hz;
    (epoch.code_phase_chips - signal.chips_at(t) + 511.5).rem_euclid(1023.0) - 511.5
}

#[test]
fn follows_a_signal_and_reports_honest_variances() {
    for cn0 in [33.0, 38.0, 45.0] {
        let (mut code, mut doppler, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..12 {
            let mut signal = IdealSignal::new(cn0, seed);
            let mut run = Run::new(&signal, 0.12, 21.0);
            for k in 1..=100 {
                let t = 0.1 * f64::from(k);
                let epoch = run.to(&mut signal, t).unwrap();
                if k > 20 {
                    assert_eq!(epoch.lock, Lock::Carrier, "{cn0} dB-Hz at {t} s");
                    code += code_error(&signal, &epoch).powi(2) / epoch.code_variance_chips2;
                    let truth = signal.doppler_hz + signal.doppler_rate_hz_s * t;
                    doppler += (epoch.doppler_hz - truth).powi(2) / epoch.doppler_variance_hz2;
                    count += 1.0;
                    // 1 s of smoothing: 0.2 dB at 33 dB-Hz, five of them.
                    assert!((epoch.cn0_dbhz - cn0).abs() < 1.0);
                }
            }
        }
        // Code errors are correlated over some 5 s: 12 runs of 8 s hold about 20 independent
        // ones, whose mean square spreads by 0.3; Dopplers 960, 0.05, and some excess for
        // what the acceleration adds.
        assert!(
            (0.4..2.0).contains(&(code / count)),
            "code {} at {cn0}",
            code / count
        );
        let ratio = doppler / count;
        assert!((0.8..1.5).contains(&ratio), "Doppler {ratio} at {cn0}");
    }
}

#[test]
fn frequency_alone_is_tracked_without_carrier_lock() {
    let frequency_hz = 4.0;
    let bandwidth = CarrierBandwidth {
        phase_hz: 0.0,
        frequency_hz,
    };
    let settings = TrackingSettings {
        locked_bandwidth: bandwidth,
        ..TrackingSettings::default()
    }
    .check()
    .unwrap();
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..8 {
        let mut signal = IdealSignal::new(45.0, seed);
        let mut run = Run::new(&signal, 0.12, 21.0);
        run.channel = Channel::new(&signal.hit(0.12, 21.0), signal.front_end, settings);
        for k in 1..=100 {
            let t = 0.1 * f64::from(k);
            let epoch = run.to(&mut signal, t).unwrap();
            if k > 20 {
                assert_eq!(epoch.lock, Lock::Code, "at {t} s");
                let truth = signal.doppler_hz + signal.doppler_rate_hz_s * t;
                squares += (epoch.doppler_hz - truth).powi(2) / epoch.doppler_variance_hz2;
                count += 1.0;
            }
        }
    }
    // 640 epochs: 6 %; earlier phases, which the variance leaves out, add a term of the order of loop
    // bandwidth times integration.
    let ratio = squares / count;
    assert!((0.8..1.4).contains(&ratio), "{ratio}");
}

#[test]
fn demodulates_every_bit_from_the_first_whole_one() {
    for cn0 in [33.0, 45.0] {
        let mut signal = IdealSignal::new(cn0, 1);
        let mut run = Run::new(&signal, 0.12, 21.0);
        run.to(&mut signal, 10.0);
        // 10 s, from the first whole bit on (code phase 5000 of 20460 chips: 15.1 ms).
        assert!((498..=499).contains(&run.bits.len()));
        let polarity = f64::from(run.bits[300].soft).signum() * signal.bit_at(bit_middle(300));
        for (k, bit) in run.bits.iter().enumerate() {
            assert_eq!(bit.code_period, run.bits[0].code_period + 20 * k as u64);
            let sent = signal.bit_at(bit_middle(k)) * polarity;
            assert_eq!(f64::from(bit.soft).signum(), sent, "bit {k} at {cn0}");
        }
    }
}

/// Middle of the k-th whole bit of the ideal signal, s.
fn bit_middle(k: usize) -> f64 {
    (20_460.0 - 5_000.3) / 1.023e6 + 0.02 * (k as f64 + 0.5)
}

#[test]
fn an_inverted_spectrum_shows_in_the_code() {
    let mut signal = IdealSignal::new(50.0, 3);
    signal.doppler_hz = -3_000.0;
    let mut run = Run::new(&signal, 0.0, 10.0);
    let mut inverted = signal.hit(0.0, 10.0);
    inverted.doppler_hz = 2_990.0;
    // The bank's signal, received upside down: its carrier turns the other way.
    signal.mirrored = true;
    run.channel = Channel::new(&inverted, signal.front_end, TrackingSettings::default());
    let mut taps = Vec::new();
    let sync = loop {
        let replica = run.channel.replica().unwrap();
        signal.correlate(&[replica], &mut taps).unwrap();
        let update = run.channel.update(&replica, &taps[0], &run.noise);
        if let Some(sync) = update.bit_sync {
            break sync;
        }
    };
    let expected = -2.0 * sync.doppler_hz / 1540.0;
    // Four reported sigmas, and far from none.
    let sigma = sync.code_slip_variance_hz2.sqrt();
    assert!((sync.code_slip_hz - expected).abs() < 4.0 * sigma);
    assert!(expected.abs() > 4.0 * sigma);
}

#[test]
fn a_lost_signal_is_noticed_at_once_and_given_up_in_time() {
    let mut signal = IdealSignal::new(42.0, 7);
    signal.ends_s = 5.0;
    let mut run = Run::new(&signal, 0.0, 0.0);
    run.to(&mut signal, 5.0);
    assert_eq!(run.channel.faded_since(), None);
    run.to(&mut signal, 5.03);
    let since = run.channel.faded_since().unwrap();
    // Within one integration of 10 ms.
    assert!((since as f64 / 2.6e6 - 5.0).abs() < 0.011);
    assert_eq!(run.to(&mut signal, 15.0), None);
    assert_eq!(run.channel.lock(), Lock::Lost);
}

#[test]
fn a_channel_on_noise_gives_up() {
    let mut signal = IdealSignal::new(45.0, 8);
    signal.ends_s = 0.0;
    let mut run = Run::new(&signal, 0.0, 0.0);
    run.to(&mut signal, 3.0);
    assert_eq!(run.channel.lock(), Lock::Lost);
    assert!(run.bits.is_empty());
}

#[test]
fn a_short_stretch_already_has_an_epoch() {
    let mut signal = IdealSignal::new(43.0, 9);
    let mut run = Run::new(&signal, 0.1, 30.0);
    let epoch = run.to(&mut signal, 0.035).unwrap();
    assert_eq!(epoch.lock, Lock::PullIn);
    // Four reported sigmas.
    assert!(code_error(&signal, &epoch).powi(2) < 16.0 * epoch.code_variance_chips2);
}

#[test]
fn a_channel_released_late_does_not_go_back_to_its_start() {
    // Bits are known within half a second; navigation steers on for three.
    let mut signal = IdealSignal::new(45.0, 11);
    let mut run = Run::new(&signal, 0.0, 0.0);
    let rate_hz = signal.front_end.sample_rate_hz;
    let mut now_s = 0.0;
    for k in 1..=150 {
        now_s = f64::from(k) * 0.02;
        run.to(&mut signal, now_s);
        let doppler_hz = signal.doppler_hz + signal.doppler_rate_hz_s * now_s;
        let to = Steering {
            tick: (now_s * rate_hz).round() as u64,
            code_phase_chips: signal.chips_at(now_s).rem_euclid(1023.0),
            periods_into_bit: None,
            code_rate_hz: 1.023e6 * (1.0 + doppler_hz / 1575.42e6),
            doppler_hz,
        };
        assert!(run.channel.steer_early(&to));
    }
    run.channel.release(1e-4);
    let start_s = run.channel.replica().unwrap().start_tick as f64 / rate_hz;
    // Two seconds of samples are kept.
    assert!(now_s - start_s < 1.6 && start_s <= now_s, "{start_s} s");
    let epoch = run.to(&mut signal, 5.0).unwrap();
    assert_eq!(epoch.lock, Lock::Carrier);
    assert!(code_error(&signal, &epoch).abs() < 0.05);
}
