//! Recordings that were tampered with: what must be found out.

use krait_record::{About, Recording, RecordingWriter};
use krait_schema::Sample;
use std::collections::BTreeMap;
use std::path::Path;

/// Writes a recording anew with some samples changed.
pub fn rewrite(from: &str, to: &str, mut change: impl FnMut(&mut Sample)) {
    rewrite_some(from, to, |sample| {
        change(sample);
        true
    });
}

/// Writes a recording anew with some samples changed, and without those of which the function says `false`.
pub fn rewrite_some(from: &str, to: &str, mut change: impl FnMut(&mut Sample) -> bool) {
    let recording = Recording::open(Path::new(from)).expect("readable");
    let about = About::run("changed", &BTreeMap::new(), recording.contents().attachments.clone());
    let mut writer = RecordingWriter::create(Path::new(to), 1 << 18, &about).expect("created");
    for recorded in recording.samples().expect("samples") {
        let mut sample = recorded.expect("readable").sample;
        if change(&mut sample) {
            writer.write(&sample, sample.sample_ns()).expect("written");
        }
    }
    writer.finish(&BTreeMap::new()).expect("finished");
}
