//! Effects beside shapes that no effect makes: what each of them does, and which effects stand without the shapes.

use super::gate::{Blocks, HeldOut, held_out};
use super::kind::Kind;
use super::refine::Fit;
use super::search::Search;

/// The shape in a list that brings most, with its share of the mean square that is left without it.
pub(super) fn strongest_shape(search: &Search, fit: &Fit, blocks: &Blocks, after: &HeldOut) -> Option<(Kind, f64)> {
    let shapes = fit.kinds().into_iter().filter(|kind| kind.is_shape());
    let share = |kind: Kind| {
        let without = search.part(fit, |own| own != kind, 6);
        let held = held_out(search.signal, &without, search.loss, blocks, 3);
        (kind, 1.0 - after.mean_square / held.mean_square.max(1e-300))
    };
    shapes.map(share).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What the effects of a list take away beside its shapes, as a share of what is left without them.
pub(super) fn beside(search: &Search, fit: &Fit, blocks: &Blocks, with_shapes: f64) -> f64 {
    let shapes = search.part(fit, Kind::is_shape, 8);
    let held = held_out(search.signal, &shapes, search.loss, blocks, 3);
    1.0 - with_shapes / held.mean_square.max(1e-300)
}

/// A list without the effects that do harm once its shapes are gone: a model file has no shapes, and there such an effect makes the error
/// larger that it is said to explain. With the errors beside the shapes; nothing changes in a list without shapes.
pub(super) fn without_harm(search: &Search, mut fit: Fit, mut after: HeldOut, blocks: &Blocks) -> (Fit, HeldOut) {
    let held = |fit: &Fit| held_out(search.signal, fit, search.loss, blocks, 3);
    while fit.members.iter().any(|own| own.kind.is_shape()) {
        let known = search.part(&fit, |kind| !kind.is_shape(), 8);
        let own = held(&known);
        let left = |kind: Kind| (kind, held(&search.part(&known, |own| own != kind, 8)).mean_square);
        let least = known.kinds().into_iter().map(left).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((worst, _)) = least.filter(|(_, left)| *left <= own.mean_square) else { break };
        fit = search.part(&fit, |kind| kind != worst, 8);
        after = held(&fit);
    }
    (fit, after)
}
