//! What was found of all joints, in the words of a diagnosis.

use super::columns::Hints;
use super::decide::Found;
use super::gate::HeldOut;
use super::kind::Kind;
use super::signal::Number;
use super::still::hides_gain;
use super::terms::{Values, name, term};
use crate::diagnose::{
    Calibration, CandidateAnswer, DependsOn, DiagnoseOptions, Diagnosis, FEWEST_RECORDINGS, FoundEffect,
    FoundParameter, GroupShare, ParameterVariation, Remaining, Structure, Verdict, cautions, columns_first,
    disagreements, named, next, separate_joints, stand_and_take, sure,
};
use crate::machine::{JointsLab, MachineUnderTest};
use crate::{LabError, Measurements, Names, Problem, Term};
use krait_model::joints::JointEffect;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Everything that a diagnosis says.
pub(super) struct Answer<'a> {
    pub machine: &'a JointsLab,
    pub data: &'a Measurements,
    pub options: &'a DiagnoseOptions,
    pub found: Vec<Found>,
    /// Values of the model's own effects that were found with them.
    pub own_values: &'a [Calibration],
    pub hints: Hints,
    pub n_outliers: usize,
}

/// How often, on resampled blocks, the list or one with a kind of the class in its place comes out best.
pub(super) fn frequency(
    best: &HeldOut,
    others: &[(Kind, HeldOut)],
    class: &[Kind],
    resamples: usize,
    seed: u64,
) -> f64 {
    let n_blocks = best.blocks.len();
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x005e_ed0f_b007);
    let mut n = 0;
    for _ in 0..resamples {
        let picks: Vec<usize> = (0..n_blocks).map(|_| random.next_u32() as usize % n_blocks).collect();
        let cost = |held: &HeldOut| picks.iter().map(|&b| held.blocks[b]).sum::<f64>();
        let own = cost(best);
        let winner = others.iter().map(|(kind, held)| (*kind, cost(held))).min_by(|a, b| a.1.total_cmp(&b.1));
        n += usize::from(winner.is_none_or(|(kind, cost)| cost >= own || class.contains(&kind)));
    }
    n as f64 / resamples as f64
}

/// The diagnosis.
///
/// # Errors
/// [`LabError`] where the found effects make no chain.
pub(super) fn diagnosis(answer: Answer) -> Result<Diagnosis, LabError> {
    let Answer { machine, data, options, found, own_values, hints, n_outliers } = answer;
    let (unit, scale) = machine.error_unit();
    let length = |of: &dyn Fn(&Found) -> f64| found.iter().map(of).sum::<f64>().sqrt() * scale;
    let Hints { wrong: hints, odd, order } = hints;
    let verdicts: Vec<Verdict> = found.iter().map(|own| own.verdict).collect();
    let verdict = if hints.is_empty() { Verdict::together(&verdicts) } else { Verdict::Unknown };
    let stands = |own: &Found| own.stands() && hints.is_empty();
    let mut named: Vec<(f64, FoundEffect, Term)> = Vec::new();
    let mut partial: Vec<(f64, FoundEffect)> = Vec::new();
    let mut terms = machine.effects().to_vec();
    for own in &found {
        for (slot, &kind) in own.order.iter().enumerate() {
            let place = own.fit.members.iter().position(|m| m.kind == kind);
            let Some(place) = place else { continue };
            if own.fit.members[place].is_ahead() {
                continue;
            }
            let effect = effect(machine, own, slot, place, scale)?;
            let gained = own.steps[slot] - own.steps[slot + 1];
            if stands(own) {
                let term = term(kind, own.joint, &own.values.members[place]);
                named.push((gained, effect, term));
            } else {
                partial.push((gained, effect));
            }
        }
        if stands(own) {
            terms.extend(own.in_chain().map(|(kind, values)| term(kind, own.joint, values)));
        }
    }
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    partial.sort_by(|a, b| b.0.total_cmp(&a.0));
    let effects: Vec<FoundEffect> = named.into_iter().map(|(_, effect, _)| effect).collect();
    let partial: Vec<FoundEffect> = partial.into_iter().map(|(_, effect)| effect).collect();
    let sigma = found
        .iter()
        .map(|own| own.floor.sigma)
        .sum::<Option<f64>>()
        .map(|_| length(&|own: &Found| own.floor.sigma.unwrap_or(0.0).powi(2)));
    let before = length(&|own: &Found| own.before.mean_square);
    let after = length(&|own: &Found| if stands(own) { own.after.mean_square } else { own.before.mean_square });
    let share = sigma.and_then(|floor| {
        let above = before * before - floor * floor;
        (above > 0.0 && !effects.is_empty()).then(|| ((before * before - after * after) / above).clamp(0.0, 1.0))
    });
    let worst = found.iter().max_by(|a, b| a.before.mean_square.total_cmp(&b.before.mean_square));
    let remaining = remaining(&found, share);
    let gains: Vec<f64> = found.iter().map(|own| own.values.gains[0].0).collect();
    let offsets: Vec<f64> = found.iter().map(|own| own.values.offsets[0].0).collect();
    let calibrated = machine.calibrated(&gains, &offsets);
    let separating = || effects.iter().find_map(|effect| separate_joints(&effect.class, effect.joint));
    let lost = || found.iter().filter(|own| !own.is_followed && hints.is_empty());
    let is_lost = verdict == Verdict::Unknown && lost().next().is_some();
    let next_experiment = if is_lost { None } else { next(verdict, separating, remaining.looks_like) };
    let problem = Problem::new(machine, data.clone(), &[], f64::INFINITY);
    let mut cautions: Vec<String> = hints.clone();
    cautions.extend(odd);
    cautions.extend(cautions_of(&problem, n_outliers));
    cautions.extend(found.iter().flat_map(|own| disagreeing(own, options, data)));
    if !is_lost {
        cautions.extend(lost().map(|own| not_followed(own, &data.names)));
    }
    let hidden = |own: &&Found| hides_gain(machine, data, own.joint, &options.recordings);
    cautions.extend(found.iter().filter(hidden).map(|own| {
        let joint = data.names.joint(own.joint + 1);
        format!("{joint} does not move, so that its gain cannot be seen: nothing is said of it")
    }));
    let mut calibration = calibrations(machine, found.iter().filter(|own| !hidden(own)), options);
    calibration.extend_from_slice(own_values);
    let sentence = sentence(&Said {
        verdict,
        found: &found,
        effects: &effects,
        hints: &hints,
        before,
        after,
        floor: sigma,
        share,
        unit,
        names: &data.names,
    });
    let floor = worst.map(|own| &own.floor);
    Ok(Diagnosis {
        verdict,
        sentence,
        needed_s: (verdict == Verdict::TooShort).then(|| needed_s(&found)),
        cautions,
        unit: unit.to_owned(),
        noise_floor: sigma,
        floor_source: floor.map_or("the data do not tell", |floor| floor.source),
        floor_relative_error: floor.map_or(0.0, |floor| floor.relative_error),
        floors: floor.map(|floor| floor.estimates.clone()).unwrap_or_default(),
        base_heldout_rms: before,
        final_heldout_rms: after,
        as_given_rms: length(&|own: &Found| own.as_given),
        explained_share: share,
        calibration,
        candidates: candidates(&found, &effects, scale),
        effects,
        partial,
        loads: None,
        clocks: Vec::new(),
        cameras: Vec::new(),
        order,
        model_free_rms: None,
        locked: None,
        remaining,
        proposals: worst_rest(&found).map_or(Vec::new(), |own| own.proposals.clone()),
        variations: variations(machine, &found, options, &data.names)?,
        next_experiment,
        terms,
        calibrated: Some(calibrated),
        rows: [
            data.n_rows(),
            problem.n_scored / data.n_outputs,
            n_outliers,
            found.iter().map(|own| own.n_blocks).min().unwrap_or(0),
        ],
        seed: options.seed,
    })
}

/// Numbers that depend on a column or differ in a recording, of effects that stand.
fn variations(
    machine: &JointsLab,
    found: &[Found],
    options: &DiagnoseOptions,
    names: &Names,
) -> Result<Vec<ParameterVariation>, LabError> {
    let (error_unit, scale) = machine.error_unit();
    let mut all = Vec::new();
    for own in found.iter().filter(|own| own.stands()) {
        for variation in &own.variations {
            let effect = variation.kind.name();
            let parameters = machine.parameters(&Term::new(effect, Vec::new()))?;
            let parameter = parameters.into_iter().find(|parameter| parameter.name == variation.parameter);
            let recording = variation.recording.and_then(|k| Some(options.recordings.get(k)?.0.clone()));
            let on = match (&variation.column, recording) {
                (Some(name), _) => {
                    let ((slope, slope_se), name, range) = (variation.slope, name.clone(), variation.at);
                    DependsOn::Column { name, range, slope, slope_se }
                }
                (None, Some(recording)) => DependsOn::Recording(recording),
                (None, None) => continue,
            };
            let variation = ParameterVariation {
                effect: effect.to_owned(),
                joint: own.joint + 1,
                parameter: variation.parameter,
                unit: parameter.map_or_else(|| "1".to_owned(), |parameter| parameter.unit),
                on,
                values: variation.values,
                errors: variation.mean_squares.map(|square| square.sqrt() * scale),
                is_in_answer: variation.is_in_list,
                sentence: String::new(),
            };
            all.push(variation.told(&names.joint(own.joint + 1), error_unit));
        }
    }
    Ok(all)
}

fn cautions_of(problem: &Problem, n_outliers: usize) -> Vec<String> {
    // Blocks are each joint's own here.
    cautions(problem, n_outliers, false)
}

/// Recordings in which the effects explain little of what they explain in the others, a sentence each.
fn disagreeing(own: &Found, options: &DiagnoseOptions, data: &Measurements) -> Vec<String> {
    let pairs: Vec<(f64, f64)> = own.before.blocks.iter().copied().zip(own.after.blocks.iter().copied()).collect();
    if options.recordings.len() < FEWEST_RECORDINGS
        || pairs.len() != options.recordings.len()
        || own.fit.members.is_empty()
    {
        return Vec::new();
    }
    disagreements(&pairs, &options.recordings, data, &format!("on joint {} ", own.joint + 1))
}

/// How long data must be for all joints, s.
fn needed_s(found: &[Found]) -> f64 {
    found.iter().filter_map(|own| own.needed_s).fold(0.0, f64::max)
}

fn effect(machine: &JointsLab, own: &Found, slot: usize, place: usize, scale: f64) -> Result<FoundEffect, LabError> {
    let kind = own.order[slot];
    let values = &own.values.members[place];
    let name = name(kind, values);
    let term = term(kind, own.joint, values);
    let parameters = machine.parameters(&term)?.into_iter().zip(&term.values).map(|(parameter, &value)| {
        let fitted = values.iter().find(|v| v.name == parameter.name && (v.se > 0.0 || v.se_naive > 0.0));
        FoundParameter {
            unit: parameter.unit,
            value,
            se: fitted.map_or(0.0, |v| v.se),
            se_naive: fitted.map_or(0.0, |v| v.se_naive),
            is_free: fitted.is_some(),
            on_bound: false,
            name: parameter.name,
        }
    });
    let mut class: Vec<String> = vec![name.to_owned()];
    for kind in &own.classes[slot] {
        for other in look_alikes(*kind) {
            if !class.iter().any(|own| own == other) {
                class.push((*other).to_owned());
            }
        }
    }
    Ok(FoundEffect {
        name: name.to_owned(),
        class,
        before: own.steps[slot].sqrt() * scale,
        after: own.steps[slot + 1].sqrt() * scale,
        probability: own.probabilities[slot],
        parameters: parameters.collect(),
        joint: Some(own.joint + 1),
        sketch: None,
    })
}

/// Names of a kind, with those that differ from it in nothing but how they are written.
fn look_alikes(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::LoadFriction => &["load-friction", "cone-friction"],
        Kind::Curve => &["cubic", "quadratic"],
        Kind::LinearDrift => &["linear-drift", "drift"],
        Kind::WarmUp => &["drift", "linear-drift"],
        Kind::Own(own) => own.names(),
        Kind::Scale => &["scale"],
        Kind::Offset => &["offset"],
        Kind::Quadratic => &["quadratic"],
        Kind::Cubic => &["cubic"],
        Kind::Latency => &["latency"],
        Kind::Lag => &["first-order-lag"],
        Kind::SecondOrder => &["second-order"],
        Kind::RateLimit => &["rate-limit"],
        Kind::Backlash => &["backlash"],
        Kind::BoucWen => &["bouc-wen"],
        Kind::Plays => &["prandtl-ishlinskii"],
        Kind::UnevenPlays => &["generalised-prandtl-ishlinskii"],
        Kind::DeadZone => &["dead-zone"],
        Kind::Saturation => &["saturation"],
        Kind::Creep => &["creep"],
        Kind::Periodic => &["periodic-error"],
        Kind::Coupling(_) => &["cross-coupling"],
        _ => &[],
    }
}

/// The joint of which most remains.
fn worst_rest(found: &[Found]) -> Option<&Found> {
    let structured = found.iter().filter(|own| own.structured);
    structured.max_by(|a, b| a.after.mean_square.total_cmp(&b.after.mean_square))
}

fn remaining(found: &[Found], share: Option<f64>) -> Remaining {
    let worst = worst_rest(found);
    let shown = worst.or(found.first());
    let structure =
        shown.map_or(Structure { p_value: 1.0, groups: Vec::new(), explained: 0.0 }, |own| own.structure.clone());
    let group = structure.groups.first().filter(|group: &&GroupShare| worst.is_some() && group.share > 0.0);
    Remaining {
        structured: worst.is_some(),
        p_value: structure.p_value,
        looks_like: group.map(|group| group.name),
        unexplained: share.map_or(if worst.is_some() { 1.0 } else { 0.0 }, |share| 1.0 - share),
        structure,
    }
}

/// What every fit found beside the effects.
fn calibrations<'a>(
    machine: &JointsLab,
    found: impl Iterator<Item = &'a Found>,
    options: &DiagnoseOptions,
) -> Vec<Calibration> {
    let names: Vec<String> = options.recordings.iter().map(|(name, _)| name.clone()).collect();
    let mut all = Vec::new();
    for own in found {
        all.extend(of_machine(machine, own.joint, &own.values, &names));
        let ahead = own.fit.members.iter().zip(&own.values.members).find(|(m, _)| m.is_ahead());
        if let Some((_, values)) = ahead {
            all.extend(values.iter().take(1).map(|value| Calibration {
                name: "delay".to_owned(),
                joint: Some(own.joint + 1),
                recording: None,
                value: value.value,
                se: value.se,
                unit: "s".to_owned(),
                prior: None,
                is_held: false,
            }));
        }
    }
    all
}

/// Gain and offset of a joint, of each recording.
pub(super) fn of_machine(
    machine: &JointsLab,
    joint: usize,
    values: &Values,
    recordings: &[String],
) -> Vec<Calibration> {
    let (unit, scale) = machine.error_unit();
    let gain_unit = format!("{}/{}", machine.joints().y_unit, machine.joints().u_unit);
    let one =
        |name: &'static str, r: usize, number: Number, (value, se): (f64, f64), unit: &str, scale: f64| Calibration {
            name: name.to_owned(),
            joint: Some(joint + 1),
            recording: recordings.get(r).cloned(),
            value: value * scale,
            se: if matches!(number, Number::Held(_)) { 0.0 } else { se * scale },
            unit: unit.to_owned(),
            prior: if let Number::Near(near, se) = number { Some((near * scale, se * scale)) } else { None },
            is_held: matches!(number, Number::Held(_)),
        };
    let mut all = Vec::new();
    for (r, (gain, offset)) in values.gains.iter().zip(&values.offsets).enumerate() {
        all.push(one("gain", r, machine.gain_known(joint), *gain, &gain_unit, 1.0));
        all.push(one("offset", r, machine.offset_known(joint), *offset, unit, scale));
    }
    all
}

/// Every candidate, the best of all joints.
fn candidates(found: &[Found], effects: &[FoundEffect], scale: f64) -> Vec<CandidateAnswer> {
    let mut all: Vec<CandidateAnswer> = Vec::new();
    for own in found {
        for single in &own.singles {
            let name = single.kind.name();
            let of_library = || JointEffect::from_name(name).map(|own| own.definition().class.label());
            let looks_like = if let Kind::Own(own) = single.kind { Some(own.class()) } else { of_library() };
            let Some(looks_like) = looks_like else { continue };
            let class = effects.iter().find(|effect| effect.class.iter().any(|other| other == name));
            let state = match (effects.iter().position(|effect| effect.name == name), class) {
                (Some(n), _) => format!("chosen, number {}", n + 1),
                (None, Some(effect)) => format!("cannot be told from {}", effect.name),
                (None, None) if single.p_value >= 0.05 => "no sign of it".to_owned(),
                (None, None) => "fitted, explains less".to_owned(),
            };
            // What the joint's error becomes, the others as they are.
            let others: f64 = found.iter().filter(|f| f.joint != own.joint).map(|f| f.before.mean_square).sum();
            let rms = (others + single.mean_square).sqrt() * scale;
            all.push(CandidateAnswer {
                name,
                class: looks_like,
                heldout_rms: Some(rms),
                probability: class.map_or(0.0, |effect| effect.probability),
                p_value: single.p_value,
                state,
            });
        }
    }
    CandidateAnswer::best_of_each(all)
}

struct Said<'a> {
    verdict: Verdict,
    found: &'a [Found],
    effects: &'a [FoundEffect],
    hints: &'a [String],
    before: f64,
    after: f64,
    floor: Option<f64>,
    share: Option<f64>,
    unit: &'a str,
    names: &'a Names,
}

fn sentence(said: &Said) -> String {
    let Said { unit, before, after, .. } = said;
    if let Some(hint) = said.hints.first() {
        return columns_first(hint);
    }
    let floor =
        said.floor.map_or("an unknown noise floor".to_owned(), |floor| format!("a noise floor of {floor:.3} {unit}"));
    let several = said.found.len() > 1;
    let on_joint = |effect: &FoundEffect| {
        effect.joint.filter(|_| several).map_or(String::new(), |joint| format!(" on {}", said.names.joint(joint)))
    };
    let names = named(said.effects, on_joint);
    let lost = said.found.iter().find(|own| !own.is_followed);
    let explained =
        said.share.map_or(String::new(), |share| format!(", {:.0} % of what there was to explain", 100.0 * share));
    match said.verdict {
        Verdict::None => {
            format!(
                "nothing is missing: after calibration an error of {after:.3} {unit} beside {floor} is the measurement's own"
            )
        }
        Verdict::Missing => format!(
            "missing: {names}; with it the error on data it was not fitted to falls from {before:.3} to {after:.3} {unit}, beside {floor}; {}",
            sure(said.effects)
        ),
        Verdict::Partly => {
            let depends =
                worst_rest(said.found).and_then(|own| own.structure.groups.first().filter(|group| group.share > 0.0));
            format!(
                "partly: {names} {} the error from {before:.3} to {after:.3} {unit}{explained}; a rest remains beside \
                 {floor}{}; {}",
                stand_and_take(said.effects.len()),
                depends.map_or(String::new(), |group| format!(", and it depends on {}", group.name)),
                sure(said.effects)
            )
        }
        Verdict::TooShort => {
            let needed = needed_s(said.found);
            format!(
                "too short to test: what is left remembers so long that about {needed:.0} s of such data are needed"
            )
        }
        Verdict::Unknown if lost.is_some() => lost.map_or(String::new(), |own| not_followed(own, said.names)),
        Verdict::Unknown => format!(
            "something is missing that no known effects explain: {before:.3} {unit} remain after calibration beside {floor}{}",
            by_column(said.found)
        ),
    }
}

/// A column beside the motion that takes most of what remains.
fn by_column(found: &[Found]) -> String {
    let most = worst_rest(found).and_then(|own| own.proposals.first()).filter(|own| own.share > 0.5);
    most.and_then(|own| own.column.as_ref().map(|(_, column)| (own.share, column)))
        .map_or(String::new(), |(share, column)| format!(", and {column:?} takes {:.0} % of that", 100.0 * share))
}

/// Where a measurement has nothing of its command.
fn not_followed(own: &Found, names: &Names) -> String {
    let joint = own.joint + 1;
    format!(
        "the measurement of {} does not follow its input, of which it has nothing that is told from chance: look at the columns, the \
         cable and the sensor",
        names.joint(joint)
    )
}
