use super::*;
use crate::basics::ledger::InMemory;
use crate::basics::seed::Seed;
use crate::stages::select::Ranked;
use crate::world::policy::PolicyShape;

fn learner() -> Learner {
    let filter = ObservationFilter::new(vec![0.1, -2.0, 1e-7], vec![1.0, 0.3, 5.0]);
    let shape = PolicyShape { hidden: vec![5, 4], initial_std: 0.37 };
    Learner {
        policy: Policy::untrained(&shape, filter, 2, Seed::new(1)),
        discriminator: Discriminator::undecided(&[6], 5, Seed::new(2)).with_noise(0.3),
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn recalled(bytes: &[u8]) -> Result<Option<Learner>> {
    let mut ledger = InMemory::default();
    ledger.store(PRIOR, bytes)?;
    Learner::recall(&ledger, "")
}

fn written(change: impl FnOnce(&mut Vec<Tensor>)) -> Vec<u8> {
    let Learner { policy, discriminator } = learner();
    let mut tensors = policy_tensors(POLICY, &policy);
    tensors.extend(discriminator_tensors(&discriminator));
    change(&mut tensors);
    write_tensors(&tensors)
}

#[test]
fn a_prior_comes_back_to_the_bit_and_its_bytes_are_the_same_each_time() {
    let learner = learner();
    let mut ledgers = [InMemory::default(), InMemory::default()];
    for ledger in &mut ledgers {
        learner.store(ledger, "").expect("memory");
    }
    let bytes = ledgers.each_ref().map(|ledger| ledger.recall(PRIOR).expect("memory"));
    assert_eq!(bytes[0], bytes[1]);
    let back = Learner::recall(&ledgers[0], "").expect("readable").expect("kept");
    assert_eq!(back, learner);
    assert_eq!(bits(back.policy.parameters()), bits(learner.policy.parameters()));
    assert_eq!(bits(back.policy.filter().mean()), bits(learner.policy.filter().mean()));
    assert_eq!(bits(back.discriminator.parameters()), bits(learner.discriminator.parameters()));
}

#[test]
fn what_was_judged_comes_back_with_every_adapted_policy() {
    let of = |demo: usize, shift: f32| {
        let policy = learner().policy;
        let moved = policy.moved(&vec![shift; policy.parameters().len()]);
        let (demo, variant) = (DemoId(demo), EnvVariant(1));
        let (before, after, distances) = (vec![vec![0.5]], vec![vec![0.1 + 0.2]], vec![3.25]);
        let suitability =
            Suitability { demo, variant, before, after, distances, curves: vec![vec![]], evaluated: None };
        (suitability, AdaptedPolicy { demo, variant, policy: moved })
    };
    let (suitabilities, adapted) = [of(0, 0.1), of(1, -0.2)].into_iter().unzip();
    let judged = Judged { scores: ScoreTable::new(suitabilities), adapted };
    let mut ledger = InMemory::default();
    judged.store(&mut ledger, "paper").expect("memory");
    assert_eq!(Judged::recall(&ledger, "cloning").expect("readable"), None, "another judge");
    assert_eq!(Judged::recall(&ledger, "paper").expect("readable"), Some(judged));
    ledger.forget(&adapted_name("paper")).expect("memory");
    assert_eq!(Judged::recall(&ledger, "paper").expect("readable"), None, "it is judged again");
}

#[test]
fn a_policy_comes_back_to_the_bit() {
    let policy = learner().policy;
    let bytes = write_policy(&policy);
    assert_eq!(read_policy(&bytes, "policy").expect("readable"), policy);
    assert_eq!(bytes, write_policy(&policy));
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let whole = written(|_| ());
    assert!(recalled(&whole).expect("readable").is_some());
    for length in (0..whole.len()).step_by(7) {
        let error = recalled(&whole[..length]).expect_err("cut short");
        assert!(error.is_bad_input() && error.to_string().contains(PRIOR), "{error}");
    }
}

#[test]
fn a_changed_byte_of_the_header_never_panics() {
    let whole = written(|_| ());
    for position in 0..whole.len().min(1500) {
        for change in [1, 0x80] {
            let mut bytes = whole.clone();
            bytes[position] ^= change;
            let _ = recalled(&bytes);
        }
    }
}

#[test]
fn a_flipped_bit_anywhere_is_an_error() {
    let (prior, checkpoint) = (written(|_| ()), write_checkpoint(&vec![1_u32, 70_000, 3]));
    for bit in (0..8 * prior.len()).step_by(11) {
        let mut bytes = prior.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let error = recalled(&bytes).expect_err("damaged");
        assert!(error.is_bad_input() && error.to_string().contains(PRIOR), "{bit}: {error}");
    }
    for bit in 0..8 * checkpoint.len() {
        let mut bytes = checkpoint.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let error = read_checkpoint::<Vec<u32>>(&bytes, "checkpoint").expect_err("damaged");
        assert!(error.to_string().starts_with("checkpoint ") && error.hint().is_some(), "{bit}: {error}");
    }
}

/// Written by the version before.
#[test]
fn a_policy_without_a_checksum_can_still_be_played() {
    let policy = learner().policy;
    let bytes = write_policy(&policy);
    let (header, tensors) = header_and_tensors(&bytes).expect("written just now");
    let text = std::str::from_utf8(header).expect("JSON");
    let start = text.find(TENSORS_HEAD).expect("sealed");
    let end = start + TENSORS_HEAD.len() + seal::DIGITS + 1;
    let mut before = format!("{}{}", &text[..start], text[end..].trim_end());
    before += &" ".repeat(before.len().next_multiple_of(HEADER_UNIT) - before.len());
    let old = [&(before.len() as u64).to_le_bytes()[..], before.as_bytes(), tensors].concat();
    assert_eq!(read_policy(&old, "policy").expect("readable"), policy);
}

#[test]
fn the_discriminator_of_a_prior_without_noise_had_none() {
    let before = written(|tensors| tensors.retain(|tensor| tensor.name != NOISE));
    assert_eq!(recalled(&before).expect("readable").expect("kept").discriminator.noise(), 0.0);
}

#[test]
fn tensors_that_do_not_fit_are_told_by_name() {
    let complaint = |change: fn(&mut Vec<Tensor>)| {
        let error = recalled(&written(change)).expect_err("does not fit");
        assert!(error.is_bad_input());
        error.to_string()
    };
    let missing = complaint(|tensors| tensors.retain(|tensor| tensor.name != "policy.log_std"));
    assert!(missing.contains("has no tensor 'policy.log_std'; it has: "), "{missing}");
    let shape = complaint(|tensors| tensors[2].shape.reverse());
    assert!(shape.contains("policy.1.weight"), "{shape}");
    let short = complaint(|tensors| {
        let log_std = tensors.iter_mut().find(|tensor| tensor.name == "policy.log_std").expect("written");
        (log_std.shape, log_std.values) = (vec![1], vec![0.0]);
    });
    assert!(short.contains("'policy.log_std' has 1 numbers, and must have 2"), "{short}");
    let broken = complaint(|tensors| tensors[0].values[3] = f32::NAN);
    assert!(broken.contains("'policy.0.weight' holds NaN"), "{broken}");
    let loud = complaint(|tensors| {
        let noise = tensors.iter_mut().find(|tensor| tensor.name == NOISE).expect("written");
        noise.values = vec![1.5];
    });
    assert!(loud.contains("'discriminator.noise' must hold one number from 0 to 1"), "{loud}");
    let unfit = complaint(|tensors| {
        tensors.retain(|tensor| !tensor.name.starts_with("discriminator"));
        let other = Discriminator::undecided(&[6], 9, Seed::new(2));
        tensors.extend(network_tensors("discriminator", other.network(), other.parameters()));
    });
    assert!(unfit.contains("maps 9 numbers to 1, and must map 5 to 1"), "{unfit}");
}

#[test]
fn files_of_another_version_are_refused() {
    let mut newer = written(|_| ());
    let entry = b"\"demosift_format\":\"1\"";
    let place = newer.windows(entry.len()).position(|window| window == entry).expect("written") + 19;
    newer[place] = b'7';
    let error = recalled(&newer).expect_err("newer");
    assert_eq!(error.to_string(), format!("{PRIOR} has format version 7; this demosift reads version 1"));
    newer[place - 18] = b'x';
    assert!(recalled(&newer).expect_err("foreign").to_string().contains("not written by demosift"));

    let mut checkpoint = write_checkpoint(&vec![1_u32, 2]);
    assert_eq!(read_checkpoint::<Vec<u32>>(&checkpoint, "x").expect("readable"), [1, 2]);
    assert!(read_checkpoint::<Vec<u32>>(&checkpoint[..3], "x").expect_err("short").is_bad_input());
    assert!(read_checkpoint::<Vec<u32>>(&checkpoint[..5], "x").expect_err("short").hint().is_some());
    checkpoint[0] = 9;
    let error = read_checkpoint::<Vec<u32>>(&checkpoint, "x").expect_err("newer");
    assert_eq!(error.to_string(), "x has format version 9; this demosift reads version 7");
}

#[test]
fn json_nouns_come_back_and_bad_ones_are_told() {
    let ranking = Ranking {
        entries: vec![Ranked { demo: DemoId(3), before: 0.1 + 0.2, after: -1e-300, gain: f64::MAX }],
    };
    let mut ledger = InMemory::default();
    assert_eq!(Ranking::recall(&ledger, "").expect("nothing is no error"), None);
    ranking.store(&mut ledger, "").expect("memory");
    assert_eq!(Ranking::recall(&ledger, "").expect("readable"), Some(ranking));
    for bad in ["", "{", "{\"version\": 2}", "{\"version\": 1, \"entries\": []}", "[1]"] {
        ledger.store("ranking.json", bad.as_bytes()).expect("memory");
        let error = Ranking::recall(&ledger, "").expect_err("bad");
        assert!(error.is_bad_input() && error.to_string().contains("ranking.json"), "{error}");
    }
}
