//! Every message survives the way into a file and back bit for bit, whatever its fields hold.

use crate::common::{MAX_WORDS, sample_of, words_of};
use krait_schema::{Channel, decode, encode};
use proptest::prelude::*;

/// Bits of any kind, with those that are easily lost made likely: zeros of both signs, NaNs with a payload, extremes.
fn word() -> impl Strategy<Value = u64> {
    prop_oneof![
        4 => any::<u64>(),
        1 => Just(0),
        1 => Just((-0.0_f64).to_bits()),
        1 => Just(f64::NAN.to_bits() | 0x1234),
        1 => Just(0x7ff0_0000_0000_0001),
        1 => Just(u64::MAX),
        1 => Just(1),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn every_message_comes_back_bit_for_bit(words in prop::collection::vec(word(), MAX_WORDS)) {
        let mut bytes = Vec::new();
        for channel in Channel::ALL {
            let sample = sample_of(channel, &words);
            encode(&sample, &mut bytes).expect("a Vec grows");
            let back = decode(channel, &bytes).expect("what was encoded");
            prop_assert_eq!(words_of(&back), words_of(&sample), "{:?}", channel);
        }
    }

    #[test]
    fn no_bytes_make_the_decoder_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for channel in Channel::ALL {
            if let Ok(sample) = decode(channel, &bytes) {
                prop_assert_eq!(sample.channel(), channel);
            }
        }
    }
}

#[test]
fn a_message_of_zeros_comes_back_and_so_does_an_empty_one() {
    let mut bytes = Vec::new();
    for channel in Channel::ALL {
        let zeros = sample_of(channel, &[0; MAX_WORDS]);
        encode(&zeros, &mut bytes).expect("a Vec grows");
        let words_from = |bytes: &[u8]| words_of(&decode(channel, bytes).expect("decoded"));
        assert_eq!(words_from(&bytes), words_of(&zeros), "{channel:?}");
        // Joints that are left out are none, not joints at zero.
        if channel != Channel::Shape {
            assert_eq!(words_from(&[]), words_of(&zeros), "an empty message is all zeros: {channel:?}");
        }
    }
}
