//! Segments over their whole ranges: derivatives against differences, sharing against oracles, the inverse against the forward model.

use crate::allocations::allocations_of;
use krait_model::EffectSetting;
use krait_model::effects::EffectKind;
use krait_model::segments::{
    Bends, LineValues, LoadSharing, MAX_LINES, SegmentChain, SegmentParameters, SegmentRateWeights, SegmentStatus,
    Segments, SegmentsParameters, Sharing,
};
use nalgebra::Vector6;

/// SplitMix64.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() >> 33) as usize % n
    }
}

/// One to three segments with 2 to 6 lines each, 3 to 12 in all.
fn drawn(draw: &mut Draw) -> SegmentsParameters {
    loop {
        let n = 1 + draw.below(3);
        let segments = (0..n)
            .map(|_| {
                let azimuths: Vec<f64> = (0..2 + draw.below(5)).map(|_| draw.between(-3.1, 3.1)).collect();
                let mut segment = SegmentParameters::of_table_i(&azimuths);
                segment.l_m = draw.between(0.02, 0.04);
                segment.l_d_m = draw.between(0.2, 0.6);
                segment.lines.iter_mut().for_each(|line| line.radius_m = draw.between(1.2e-3, 2e-3));
                segment
            })
            .collect();
        let parameters = SegmentsParameters { segments, ..Default::default() };
        if parameters.check().is_ok() {
            return parameters;
        }
    }
}

fn bends(draw: &mut Draw, machine: &Segments, most: f64) -> Bends {
    Bends::from_fn(|k, _| if k < machine.n_bends() { draw.between(-most, most) } else { 0.0 })
}

fn effects(all: bool) -> Vec<EffectSetting> {
    let mut effects = vec![
        EffectSetting::new(EffectKind::StiffnessScale).with("eta", 1.22).unwrap(),
        EffectSetting::new(EffectKind::InsideExtension),
    ];
    if all {
        let others = [EffectKind::StaticFriction, EffectKind::ConeFriction, EffectKind::Backlash];
        effects.extend(others.map(EffectSetting::new));
    }
    effects
}

#[test]
fn gradient_hessian_tip_and_alpha_are_the_differences_of_what_they_belong_to() {
    let mut draw = Draw(1);
    for _ in 0..40 {
        let mut parameters = drawn(&mut draw);
        parameters.preload_n = draw.between(-5.0, 5.0);
        let chain = SegmentChain::new(&parameters, &effects(false)).unwrap();
        let machine = chain.machine();
        let b = bends(&mut draw, machine, 0.7);
        let (_, j) = machine.tip(&b);
        let mut compensator = chain.compensator();
        compensator.step(&b);
        let whole = machine.j() + compensator.alpha_m_per_rad();
        let vel = bends(&mut draw, machine, 1.0);
        let rates = compensator.rates_m_per_s(&vel);
        assert!((rates - whole * vel).amax() < 1e-12, "{rates}");
        assert!((machine.tip_pos_in_base_m(&b) - machine.tip(&b).0).amax() < 1e-15);
        for i in 0..machine.n_bends() {
            let h = 1e-5;
            let step = Bends::from_fn(|k, _| if k == i { h } else { 0.0 });
            let by = |f: &dyn Fn(&Bends) -> f64| (f(&(b + step)) - f(&(b - step))) / (2.0 * h);
            let (grad, hess) = (machine.grad_energy_nm(&b), machine.hess_energy_nm(&b));
            assert!((by(&|b| machine.energy_j(b)) - grad[i]).abs() < 1e-8 * grad.norm().max(1e-3));
            for k in 0..machine.n_bends() {
                assert!((by(&|b| machine.grad_energy_nm(b)[k]) - hess[(k, i)]).abs() < 1e-7 * hess.norm());
            }
            for k in 0..3 {
                let tip = by(&|b| machine.base_from_tip(b).translation.vector[k]);
                assert!((tip - j[(k, i)]).abs() < 1e-9, "{tip} {}", j[(k, i)]);
            }
            let turned =
                machine.base_from_tip(&(b + step)).rotation * machine.base_from_tip(&(b - step)).rotation.inverse();
            let turned = turned.scaled_axis() / (2.0 * h);
            (0..3).for_each(|k| assert!((turned[k] - j[(3 + k, i)]).abs() < 1e-7));
            let told = |b: &Bends| chain.compensator().step(b).q_tilde_m;
            let difference = (told(&(b + step)) - told(&(b - step))) / (2.0 * h);
            for k in 0..machine.n_lines() {
                assert!(
                    (difference[k] - whole[(k, i)]).abs() < 1e-6 * whole.norm(),
                    "line {k}: {} {}",
                    difference[k],
                    whole[(k, i)]
                );
            }
        }
        // J~ of it undoes it.
        let undone = compensator.j_tilde_rad_per_m() * whole;
        for i in 0..machine.n_bends() {
            for k in 0..machine.n_bends() {
                assert!((undone[(i, k)] - f64::from(u8::from(i == k))).abs() < 1e-9);
            }
        }
    }
}

/// Dykstra's projections on the moments and on the bounds: no sets, no multipliers.
fn dykstra(machine: &Segments, moments: &Bends, asked: &LoadSharing) -> LineValues {
    let n = machine.n_lines();
    let own = |value: f64| LineValues::from_fn(|k, _| if k < n { value } else { 0.0 });
    let (mut x, mut p, mut q) = (own(asked.preload_n), LineValues::zeros(), LineValues::zeros());
    for _ in 0..200_000 {
        let y = x + p - machine.pinv().transpose() * (machine.j().transpose() * (x + p) - moments);
        p = x + p - y;
        let next =
            LineValues::from_fn(|k, _| if k < n { (y[k] + q[k]).clamp(asked.low_n[k], asked.high_n[k]) } else { 0.0 });
        q = y + q - next;
        let moved = (next - x).amax();
        x = next;
        if moved < 1e-13 && (x - y).amax() < 1e-11 {
            break;
        }
    }
    x
}

/// Every set of bounds, solved for its free lines by least squares: the nearest that keeps every bound, if any does.
fn exhaustive(machine: &Segments, moments: &Bends, asked: &LoadSharing) -> Option<LineValues> {
    let n = machine.n_lines();
    let mut best: Option<(f64, LineValues)> = None;
    for code in 0..3_usize.pow(n as u32) {
        let side = |k: usize| code / 3_usize.pow(k as u32) % 3;
        let mut tau = LineValues::from_fn(|k, _| match (k < n, if k < n { side(k) } else { 0 }) {
            (false, _) => 0.0,
            (true, 1) => asked.low_n[k],
            (true, 2) => asked.high_n[k],
            (true, _) => asked.preload_n,
        });
        let mut free = *machine.j();
        (0..MAX_LINES).filter(|&k| k >= n || side(k) != 0).for_each(|k| free.row_mut(k).fill(0.0));
        let rest = moments - machine.j().transpose() * tau;
        tau += free.transpose().svd(true, true).solve(&rest, 1e-9).unwrap();
        let holds = (machine.j().transpose() * tau - moments).amax() < 1e-10;
        let keeps = (0..n).all(|k| tau[k] >= asked.low_n[k] - 1e-8 && tau[k] <= asked.high_n[k] + 1e-8);
        let distance = (0..n).map(|k| (tau[k] - asked.preload_n).powi(2)).sum::<f64>();
        if holds && keeps && best.as_ref().is_none_or(|(least, _)| distance < *least) {
            best = Some((distance, tau));
        }
    }
    best.map(|(_, tau)| tau)
}

#[test]
fn shared_loads_are_those_of_every_set_tried_and_of_projections_wherever_the_search_begins() {
    let mut draw = Draw(2);
    let (mut n_bounded, mut n_infeasible, mut most_pivots) = (0, 0, 0);
    for round in 0..600 {
        let machine = Segments::new(&drawn(&mut draw)).unwrap();
        let moments = machine.grad_energy_nm(&bends(&mut draw, &machine, 0.6)) * 1.22;
        let low = draw.between(-60.0, -10.0);
        let asked = LoadSharing {
            low_n: LineValues::repeat(low),
            high_n: LineValues::repeat(if round % 3 == 0 { -0.5_f64.max(low) } else { draw.between(5.0, 60.0) }),
            preload_n: draw.between(-3.0, 3.0),
        };
        let found = machine.share_loads(&moments, &asked, &[0; MAX_LINES]);
        most_pivots = most_pivots.max(found.n_pivots);
        let begin = core::array::from_fn(|_| draw.below(3) as i8 - 1);
        let other = machine.share_loads(&moments, &asked, &begin);
        most_pivots = most_pivots.max(other.n_pivots);
        assert_eq!(found.sharing.holds(), other.sharing.holds(), "{round}: {:?} {:?}", found.sharing, other.sharing);
        if found.sharing.holds() {
            n_bounded += u32::from(matches!(found.sharing, Sharing::Bounded { .. }));
            assert!((found.tau_n - other.tau_n).amax() < 1e-8, "{round}");
            assert!((machine.j().transpose() * found.tau_n - moments).amax() < 1e-11, "{round}");
            let projected = dykstra(&machine, &moments, &asked);
            let reached = (machine.j().transpose() * projected - moments).amax() < 1e-9;
            assert!(!reached || (found.tau_n - projected).amax() < 1e-6, "{round}: {} {}", found.tau_n, projected);
        } else {
            n_infeasible += 1;
            assert!(matches!(found.sharing, Sharing::Infeasible { .. }), "{round}: {:?}", found.sharing);
        }
        if machine.n_lines() <= 7 {
            let tried = exhaustive(&machine, &moments, &asked);
            assert_eq!(tried.is_some(), found.sharing.holds(), "{round}: {:?}", found.sharing);
            assert!(tried.is_none_or(|tau| (tau - found.tau_n).amax() < 1e-6), "{round}");
        }
    }
    assert!(n_bounded > 60 && n_infeasible > 20, "{n_bounded} bounded, {n_infeasible} infeasible");
    assert!(most_pivots <= 36, "{most_pivots} pivots");
}

#[test]
fn what_the_inverse_tells_the_actuators_bends_the_segments_as_wanted() {
    let mut draw = Draw(3);
    for with_friction in [false, true] {
        for round in 0..12 {
            let mut parameters = drawn(&mut draw);
            parameters.settings.transition_m = 1e-9;
            let chain = SegmentChain::new(&parameters, &effects(with_friction)).unwrap();
            let (mut compensator, mut predictor) = (chain.compensator(), chain.predictor());
            let goal = bends(&mut draw, chain.machine(), 0.6);
            // One way, then back by a part: every line turns around.
            let back = goal * 0.3;
            let way = (1..=200).map(|k| goal * (f64::from(k) / 200.0));
            let way = way.chain((1..=200).map(|k| goal + (back - goal) * (f64::from(k) / 200.0)));
            let mut found = Bends::zeros();
            let mut last = Bends::zeros();
            for (k, b) in way.enumerate() {
                found = predictor.step(&compensator.step(&b).q_tilde_m);
                last = b;
                if k % 50 == 49 || !with_friction {
                    assert!(
                        (found - b).amax() < if with_friction { 2e-3 } else { 1e-9 },
                        "{round} {k}: {} {}",
                        found,
                        b
                    );
                }
            }
            assert!((found - last).amax() < if with_friction { 2e-3 } else { 1e-9 }, "{round}");
            assert_eq!(predictor.n_unsolved(), 0);
        }
    }
}

#[test]
fn loads_that_cannot_be_kept_hold_the_command_and_name_the_line() {
    let azimuths = [0.0, 120.0, 240.0].map(f64::to_radians);
    let segments = vec![SegmentParameters::of_table_i(&azimuths)];
    let parameters = SegmentsParameters { segments, low_n: -12.0, high_n: 30.0, ..Default::default() };
    let mut compensator = SegmentChain::new(&parameters, &[]).unwrap().compensator();
    let bend = |rad: f64| Bends::from_fn(|k, _| if k == 0 { rad } else { 0.0 });
    let good = compensator.step(&bend(0.5));
    assert!(matches!(good.status, SegmentStatus::Good(Sharing::Preferred)), "{:?}", good.status);
    let bounded = compensator.step(&bend(0.7));
    assert!(matches!(bounded.status, SegmentStatus::Good(Sharing::Bounded { line_idx: 0 })), "{:?}", bounded.status);
    assert!((bounded.tau_n[0] + 12.0).abs() < 1e-9);
    let narrow = SegmentsParameters { high_n: 3.0, ..parameters };
    let mut compensator = SegmentChain::new(&narrow, &[]).unwrap().compensator();
    let good = *compensator.step(&bend(0.2));
    let held = *compensator.step(&bend(1.2));
    assert!(matches!(held.status, SegmentStatus::Held(Sharing::Infeasible { .. })), "{:?}", held.status);
    assert_eq!(held.q_tilde_m, good.q_tilde_m);
    assert_eq!(compensator.step(&(bend(0.2) * f64::NAN)).q_tilde_m, good.q_tilde_m);
}

#[test]
fn the_tip_goes_as_wanted_where_the_segments_can() {
    let azimuths = |offset: f64| [0.0, 120.0, 240.0].map(|own: f64| (own + offset).to_radians());
    let segments = vec![SegmentParameters::of_table_i(&azimuths(0.0)), SegmentParameters::of_table_i(&azimuths(60.0))];
    let machine = Segments::new(&SegmentsParameters { segments, ..Default::default() }).unwrap();
    let weights = SegmentRateWeights { axial: 1.0, turn_m_per_rad: 0.5e-3, damping_m_per_rad: 0.1e-3 };
    let b = Bends::from_row_slice(&[0.4, 0.2, -0.3, 0.5, 0.0, 0.0]);
    // Advancing has the smallest gain here, and turning costs it most.
    for (wanted, left) in [([1.0, 0.0, 0.0], 5e-3), ([0.0, 1.0, 0.0], 5e-3), ([0.0, 0.0, 1.0], 2e-2)] {
        let twist = Vector6::new(1e-2 * wanted[0], 1e-2 * wanted[1], 1e-2 * wanted[2], 0.0, 0.0, 0.0);
        let rate = machine.bend_rates(&machine.tip(&b).1, &twist, &weights);
        let moved = machine.tip(&b).1 * rate.bends_vel_rad_per_s;
        assert!((moved.fixed_rows::<3>(0) - twist.fixed_rows::<3>(0)).norm() < left * 1e-2, "{moved}");
    }
    // Straight, the two segments shift the tip without turning it: an S.
    let rate =
        machine.bend_rates(&machine.tip(&Bends::zeros()).1, &Vector6::new(1e-2, 0.0, 0.0, 0.0, 0.0, 0.0), &weights);
    let moved = machine.tip(&Bends::zeros()).1 * rate.bends_vel_rad_per_s;
    assert!((moved[0] - 1e-2).abs() < 1e-5 && moved.fixed_rows::<3>(3).norm() < 1e-2, "{moved}");
    assert!(rate.bends_vel_rad_per_s[0] > 0.0 && rate.bends_vel_rad_per_s[2] < 0.0);
    // What no segment can do, advancing, does nothing.
    let rate =
        machine.bend_rates(&machine.tip(&Bends::zeros()).1, &Vector6::new(0.0, 0.0, 1e-2, 0.0, 0.0, 0.0), &weights);
    assert!(rate.bends_vel_rad_per_s.amax() < 1e-9);
}

#[test]
fn no_step_allocates_and_a_memory_restored_repeats_its_bytes() {
    let mut draw = Draw(5);
    let parameters = SegmentsParameters { low_n: -25.0, high_n: 25.0, ..drawn(&mut draw) };
    let chain = SegmentChain::new(&parameters, &effects(true)).unwrap();
    let (mut compensator, mut predictor) = (chain.compensator(), chain.predictor());
    let ways: Vec<Bends> = (0..50).map(|_| bends(&mut draw, chain.machine(), 0.5)).collect();
    let n = allocations_of(|| {
        for b in &ways {
            let memory = compensator.memory();
            let first = *compensator.step(b);
            compensator.restore(&memory);
            assert!(first == *compensator.step(b));
            std::hint::black_box(predictor.step(&first.q_tilde_m));
            std::hint::black_box(compensator.alpha_m_per_rad());
        }
    });
    assert_eq!(n, 0);
}
