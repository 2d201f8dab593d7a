//! What is left of a broken recording becomes a whole one, and a stretch of time is found without reading the rest.

use crate::common::{TestPath, chain, fresh_path, words_of};
use krait_record::{
    About, Attachment, DrawnMachine, Missing, RecordError, Recorded, Recording, RecordingWriter, RecoverError, Views,
    recover, samples_between,
};
use krait_schema::Channel;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A recording of so many milliseconds in chunks of 50 ms.
fn recorded(name: &str, n_ms: u64) -> TestPath {
    let path = fresh_path(name);
    let toml =
        Attachment { name: "krait.toml".to_owned(), media_type: "application/toml".to_owned(), data: vec![b'x'; 99] };
    let about = About::run("recover", &BTreeMap::new(), vec![toml]);
    let views = Views::new(Some(&DrawnMachine::default()), 30).expect("the default machine");
    let mut writer = RecordingWriter::create(&path, 256 * 1024, &about).expect("created").with_views(Some(views));
    for sample in chain(n_ms, krait_ipc::clock::monotonic_ns()) {
        writer.write(&sample, sample.sample_ns()).expect("written");
        if sample.channel() == Channel::State && sample.sequence().is_multiple_of(50) {
            writer.flush().expect("flushed");
        }
    }
    writer.finish(&BTreeMap::from([("n_dropped".to_owned(), "0".to_owned())])).expect("finished");
    path
}

fn read(path: &Path) -> Vec<Recorded> {
    let samples = Recording::open(path).expect("opened").samples().expect("there");
    samples.map(|recorded| recorded.expect("readable")).collect()
}

fn bits(samples: &[Recorded]) -> Vec<(u64, u64, Channel, Vec<u64>)> {
    samples.iter().map(|r| (r.log_ns, r.publish_ns, r.sample.channel(), words_of(&r.sample))).collect()
}

#[test]
fn a_file_cut_at_any_byte_becomes_a_whole_file_of_the_same_messages() {
    let path = recorded("recover_cut.mcap", 1000);
    let whole = fs::read(&path).expect("read");
    let (broken, out) = (fresh_path("broken.mcap"), fresh_path("saved.mcap"));
    for cut in (1..=30).map(|idx| 3000 + idx * (whole.len() - 3000) / 31) {
        fs::write(&broken, &whole[..cut]).expect("written");
        fs::remove_file(&out).ok();
        let saved = recover(&broken, &out).expect("recovered");
        let back = Recording::open(&out).expect("opened");
        assert!(back.contents().is_indexed, "cut at {cut}");
        assert_eq!(bits(&read(&out)), bits(&read(&broken)), "cut at {cut}");
        let expected = Recording::open(&broken).expect("opened").contents().clone();
        assert_eq!((&back.contents().attachments, back.contents().n_views), (&expected.attachments, expected.n_views));
        assert_eq!(back.contents().metadata["krait"], expected.metadata["krait"]);
        let dropped = Missing::Recovered { n_bytes: saved.n_bytes_dropped };
        assert!(back.contents().missing.contains(&dropped), "{:?}", back.contents().missing);
        assert_eq!((saved.n_bytes, saved.missing), (cut as u64, expected.missing));
        let n_messages: u64 = saved.messages.values().sum();
        assert_eq!(n_messages, read(&out).len() as u64 + expected.n_views);
        // Beyond the message indexes of the last whole chunk, the loss is less than one chunk of 50 ms.
        assert!(saved.n_bytes_dropped < whole.len() as u64 / 10, "{} of {cut}", saved.n_bytes_dropped);
    }
}

#[test]
fn damage_in_the_middle_costs_its_own_chunk_and_the_loss_is_counted_in_bytes() {
    let path = recorded("recover_middle.mcap", 1000);
    let n_before = read(&path).len();
    let mut bytes = fs::read(&path).expect("read");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 8].fill(0x55);
    fs::write(&path, &bytes).expect("written");
    let out = fresh_path("middle_saved.mcap");
    let saved = recover(&path, &out).expect("recovered");
    let n_after = read(&out).len();
    assert!(n_after < n_before && n_after > n_before * 8 / 10, "{n_after} of {n_before}");
    assert!(saved.n_bytes_dropped > 8 && saved.n_bytes_dropped < bytes.len() as u64 / 8, "{}", saved.n_bytes_dropped);
    let back = Recording::open(&out).expect("opened");
    assert_eq!(back.contents().missing, [Missing::Recovered { n_bytes: saved.n_bytes_dropped }]);
    assert!(back.contents().metadata.contains_key("krait.end"), "the end was there and stays");
}

#[test]
fn an_existing_file_is_never_overwritten_and_a_foreign_one_is_refused_without_a_trace() {
    let path = recorded("recover_whole.mcap", 100);
    let out = fresh_path("precious_saved.mcap");
    fs::write(&out, b"precious").expect("written");
    let error = recover(&path, &out).expect_err("refused");
    assert!(matches!(error, RecoverError::Write(RecordError::Exists { .. })), "{error}");
    assert_eq!(fs::read(&out).expect("there"), b"precious");
    let foreign = fresh_path("foreign_saved.mcap");
    assert!(matches!(recover(&out, &foreign).expect_err("refused"), RecoverError::Read(_)));
    assert!(!foreign.exists());
}

#[test]
fn a_stretch_of_time_is_the_same_with_and_without_an_index() {
    let path = recorded("between.mcap", 2000);
    let all = read(&path);
    let (first, last) = (all[0].log_ns, all[all.len() - 1].log_ns);
    let range = first + (last - first) / 3..first + (last - first) / 2;
    let expected: Vec<_> = all.iter().filter(|r| range.contains(&r.log_ns)).cloned().collect();
    assert!(expected.len() > 1000 && expected.len() < all.len() / 4, "{}", expected.len());
    let found = samples_between(&path, range.clone()).expect("read");
    assert_eq!(bits(&found), bits(&expected));
    let whole = fs::read(&path).expect("read");
    fs::write(&path, &whole[..whole.len() * 3 / 4]).expect("written");
    assert_eq!(bits(&samples_between(&path, range).expect("read")), bits(&expected), "without an index");
    assert_eq!(samples_between(&path, 0..first - 1_000_000_000).expect("read"), []);
}

#[test]
fn an_index_that_lies_is_an_error_or_nothing_but_never_a_panic() {
    let path = recorded("lying.mcap", 500);
    let whole = fs::read(&path).expect("read");
    let truth: std::collections::BTreeSet<_> = bits(&read(&path)).into_iter().collect();
    let begin = whole.len() - whole.len() / 8;
    for (idx, at) in (begin..whole.len()).step_by((whole.len() - begin) / 300).enumerate() {
        let mut damaged = whole.clone();
        damaged[at] ^= 1 << (idx % 8);
        fs::write(&path, &damaged).expect("written");
        if let Ok(found) = samples_between(&path, 0..u64::MAX) {
            // The index alone has no checksum here; what it leads to has.
            assert!(bits(&found).iter().all(|sample| truth.contains(sample)), "damaged at {at}");
        }
    }
}
