//! `bench corpus`: how well moving things are found on change detection sequences with truth, and at which cost.

use anyhow::{Context as _, Result, bail, ensure};
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use videofields::commands::complain;
use videofields::commands::given::{Tables, camera, pipeline};
use videofields_recording::ingest::{self, MediaRoots};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::SourceSettings;
use videofields_vision::frame::{Frame, Mask};
use videofields_vision::segment::{MOVING, SHADOW};

/// Labels of changedetection.net: what is not scored (outside of the region of interest, unknown), and what moves.
const OUTSIDE: u8 = 85;
const UNKNOWN: u8 = 170;
const TRUE_MOVING: u8 = 255;

/// Folders within folders that are looked into: a category, and its sequences.
const GREATEST_DEPTH: usize = 3;

/// The peers, for an interpreter that can import cv2.
const PEERS: &str = include_str!("corpus/peers.py");

/// Scores a folder of change detection sequences.
///
/// A sequence is a folder with input/ (numbered pictures), groundtruth/ (masks with the labels of changedetection.net, by the same
/// numbers) and temporalROI.txt (first and last number that is scored). Shadow counts as background. Every sequence is seen once, with
/// the same settings; CPU time is of decoding and vision together.
#[derive(Debug, clap::Args)]
pub(super) struct Corpus {
    /// A folder that holds sequences, at most three folders deep, or is one.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Scores this sequence alone, by its path in the folder. Repeatable.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// A setting of the camera, as in its tables of a configuration file: --set segment.delta=0.1. Repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Writes all figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Scores OpenCV's MOG2 and KNN beside it with this interpreter, which can import cv2.
    #[arg(long, value_name = "PYTHON")]
    python: Option<PathBuf>,
}

/// Pixels of one sequence by what was found of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Counts {
    /// Move and were found.
    hit: u64,
    /// Were found and do not move.
    #[serde(rename = "false")]
    false_: u64,
    /// Move and were not found.
    missed: u64,
    /// Neither move nor were found.
    clear: u64,
    /// Move and were taken for shadow.
    shadowed: u64,
    /// Have the same truth in two frames one after the other; and of these, those whose verdict turned.
    steady: u64,
    turned: u64,
}

impl Counts {
    /// Counts one frame, beside the frame before it if that is scored too.
    fn add(&mut self, (labels, truth): (&[u8], &[u8]), before: Option<(&[u8], &[u8])>) {
        let is_scored = |truth: u8| truth != OUTSIDE && truth != UNKNOWN;
        for (at, (label, truth)) in labels.iter().zip(truth).enumerate() {
            if !is_scored(*truth) {
                continue;
            }
            let (is_moving, is_found) = (*truth == TRUE_MOVING, *label == MOVING);
            let count = match (is_moving, is_found) {
                (true, true) => &mut self.hit,
                (false, true) => &mut self.false_,
                (true, false) => &mut self.missed,
                (false, false) => &mut self.clear,
            };
            *count += 1;
            self.shadowed += u64::from(is_moving && *label == SHADOW);
            let Some((labels, truth)) = before else { continue };
            if is_scored(truth[at]) && (truth[at] == TRUE_MOVING) == is_moving {
                self.steady += 1;
                self.turned += u64::from((labels[at] == MOVING) != is_found);
            }
        }
    }

    fn scores(&self) -> Scores {
        let share = |part: u64, of: u64| if of == 0 { 0.0 } else { part as f64 / of as f64 };
        let (precision, recall) =
            (share(self.hit, self.hit + self.false_), share(self.hit, self.hit + self.missed));
        let both = precision + recall;
        Scores {
            precision,
            recall,
            f: if both > 0.0 { 2.0 * precision * recall / both } else { 0.0 },
            false_positive_rate: share(self.false_, self.false_ + self.clear),
            shadow_share: share(self.shadowed, self.hit + self.missed),
            flicker: share(self.turned, self.steady),
        }
    }
}

/// Shares, 0 to 1.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Scores {
    precision: f64,
    recall: f64,
    /// Harmonic mean of precision and recall.
    f: f64,
    /// Share of the pixels that do not move which was found.
    false_positive_rate: f64,
    /// Share of the pixels that move which was taken for shadow.
    shadow_share: f64,
    /// Share of the pixels whose truth stays from a frame to the next of which the verdict does not.
    flicker: f64,
}

impl Scores {
    fn mean(all: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        Self {
            precision: mean(|of| of.precision),
            recall: mean(|of| of.recall),
            f: mean(|of| of.f),
            false_positive_rate: mean(|of| of.false_positive_rate),
            shadow_share: mean(|of| of.shadow_share),
            flicker: mean(|of| of.flicker),
        }
    }
}

/// Results of one method on one sequence; on all of them, the means.
#[derive(Clone, Debug, Serialize)]
struct Row {
    sequence: String,
    method: String,
    n_frames: u64,
    cpu_secs_per_1000_frames: f64,
    #[serde(flatten)]
    scores: Scores,
}

/// One sequence on disk.
#[derive(Debug)]
struct Sequence {
    name: String,
    folder: PathBuf,
    /// Pictures by their numbers.
    inputs: BTreeMap<u64, PathBuf>,
    truths: BTreeMap<u64, PathBuf>,
    first: u64,
    last: u64,
}

impl Sequence {
    fn open(name: String, folder: &Path) -> Result<Self> {
        let path = folder.join("temporalROI.txt");
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let numbers: Vec<u64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
        let [first, last, ..] = numbers[..] else {
            bail!("{}: expected the first and the last number that is scored", path.display())
        };
        let inputs = numbered(&folder.join("input"))?;
        let truths = numbered(&folder.join("groundtruth"))?;
        ensure!(!inputs.is_empty(), "{} holds no numbered picture", folder.join("input").display());
        Ok(Self { name, folder: folder.to_owned(), inputs, truths, first, last })
    }

    /// Returns the truth of an input; none where it is not scored.
    fn truth(&self, number: u64) -> Option<&PathBuf> {
        self.truths.get(&number).filter(|_| (self.first..=self.last).contains(&number))
    }

    /// Returns the pattern of the inputs' names, such as input/in%06d.jpg.
    fn pattern(&self) -> Result<PathBuf> {
        let (number, path) = self.inputs.first_key_value().context("a sequence has pictures")?;
        let name = path.file_name().and_then(|name| name.to_str()).context("names are text")?;
        let end = name.rfind(|c: char| c.is_ascii_digit()).context("names have numbers")? + 1;
        let start = name[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
        ensure!(name[start..end].parse() == Ok(*number), "{name} has no number");
        let (head, tail) = (&name[..start], &name[end..]);
        Ok(self.folder.join("input").join(format!("{head}%0{}d{tail}", end - start)))
    }

    /// Runs vision over all inputs and scores those that have truth.
    fn score(&self, flags: &[String]) -> Result<Row> {
        let pattern = self.pattern()?;
        let settings =
            camera(Tables::of_flags(flags.iter().map(String::as_str))?, SourceSettings::of_path(&pattern))?;
        let mut pipeline = pipeline(&settings);
        let mut source = ingest::open(&settings.source, &MediaRoots::of_caller(&pattern)?)?;
        let mut numbers = self.inputs.keys();
        let mut counts = Counts::default();
        let mut before: Option<(Arc<Mask>, Vec<u8>)> = None;
        let (mut cpu_secs, mut n_frames) = (0.0, 0);
        loop {
            let begun = cpu_now_secs();
            let Some(next) = source.next_frame()? else { break };
            let observation = pipeline.process(Frame {
                camera: settings.id.clone(),
                timestamp: Timestamp::from_nanos(next.stream_nanos),
                number: next.number,
                image: next.image,
            });
            pipeline.take_events();
            cpu_secs += cpu_now_secs() - begun;
            n_frames += 1;
            let number = numbers.next().context("there are more frames than pictures")?;
            let Some(path) = self.truth(*number) else {
                before = None;
                continue;
            };
            let truth = gray(path)?;
            ensure!(
                truth.len() == observation.labels.data.len(),
                "{} is not of its input's size",
                path.display()
            );
            let earlier = before.as_ref().map(|(labels, truth)| (&labels.data[..], truth.as_slice()));
            counts.add((&observation.labels.data, &truth), earlier);
            before = Some((observation.labels, truth));
        }
        Ok(Row {
            sequence: self.name.clone(),
            method: "videofields".to_owned(),
            n_frames,
            cpu_secs_per_1000_frames: 1000.0 * cpu_secs / n_frames.max(1) as f64,
            scores: counts.scores(),
        })
    }

    /// Scores OpenCV's methods on the same frames.
    fn peers(&self, python: &Path) -> Result<Vec<Row>> {
        #[derive(Deserialize)]
        struct Peer {
            name: String,
            counts: Counts,
            cpu_secs: f64,
            n_frames: u64,
        }
        let mut child = Command::new(python)
            .args(["-c", PEERS])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot run {}", python.display()))?;
        let mut lines = String::new();
        for (number, path) in &self.inputs {
            let truth = self.truth(*number).map_or_else(|| "-".to_owned(), |path| path.display().to_string());
            lines += &format!("{}\t{truth}\n", path.display());
        }
        let mut input = child.stdin.take().context("the peers read their input")?;
        input.write_all(lines.as_bytes()).context("cannot write to the peers")?;
        drop(input);
        let output = child.wait_with_output().context("the peers' end")?;
        ensure!(output.status.success(), "{} failed on {}", python.display(), self.name);
        let text = String::from_utf8_lossy(&output.stdout);
        let rows = text.lines().map(|line| {
            let peer: Peer = serde_json::from_str(line).context("what the peers wrote")?;
            Ok(Row {
                sequence: self.name.clone(),
                method: peer.name,
                n_frames: peer.n_frames,
                cpu_secs_per_1000_frames: 1000.0 * peer.cpu_secs / peer.n_frames.max(1) as f64,
                scores: peer.counts.scores(),
            })
        });
        rows.collect()
    }
}

/// Returns the files of a folder by the last number in their names.
fn numbered(folder: &Path) -> Result<BTreeMap<u64, PathBuf>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut found = BTreeMap::new();
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read {}", folder.display()))?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let digits = stem.rsplit(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty());
        if let Some(number) = digits.and_then(|digits| digits.parse().ok()) {
            found.insert(number, path);
        }
    }
    Ok(found)
}

/// Returns the sequences in a folder, by their paths in it.
fn sequences(folder: &Path, name: &str, depth: usize) -> Result<Vec<Sequence>> {
    if folder.join("temporalROI.txt").is_file() && folder.join("input").is_dir() {
        return Ok(vec![Sequence::open(name.to_owned(), folder)?]);
    }
    if depth == 0 {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.with_context(|| format!("cannot read {}", folder.display()))?.path());
    }
    paths.sort();
    let mut found = Vec::new();
    for path in paths.iter().filter(|path| path.is_dir()) {
        let own = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let name = if name.is_empty() { own } else { format!("{name}/{own}") };
        found.extend(sequences(path, &name, depth - 1)?);
    }
    Ok(found)
}

fn gray(path: &Path) -> Result<Vec<u8>> {
    let picture = image::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(picture.into_luma8().into_raw())
}

fn cpu_now_secs() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Returns the means of each method over its sequences.
fn means(rows: &[Row]) -> Vec<Row> {
    let mut methods: Vec<&str> = Vec::new();
    for row in rows {
        if !methods.contains(&row.method.as_str()) {
            methods.push(&row.method);
        }
    }
    let mean = |method: &str| {
        let own: Vec<&Row> = rows.iter().filter(|row| row.method == method).collect();
        let scores: Vec<Scores> = own.iter().map(|row| row.scores).collect();
        let cpu_secs: f64 = own.iter().map(|row| row.cpu_secs_per_1000_frames).sum();
        Row {
            sequence: format!("mean of {}", own.len()),
            method: method.to_owned(),
            n_frames: own.iter().map(|row| row.n_frames).sum(),
            cpu_secs_per_1000_frames: cpu_secs / own.len().max(1) as f64,
            scores: Scores::mean(&scores),
        }
    };
    methods.into_iter().map(mean).collect()
}

fn table(rows: &[Row]) -> String {
    let mut text = "| sequence | method | precision | recall | F | false positives | truth taken for shadow | flicker | CPU s per 1000 frames |\n\
                    | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n"
        .to_owned();
    for row in rows {
        let of = &row.scores;
        text += &format!(
            "| {} | {} | {:.3} | {:.3} | {:.3} | {:.5} | {:.3} | {:.5} | {:.2} |\n",
            row.sequence,
            row.method,
            of.precision,
            of.recall,
            of.f,
            of.false_positive_rate,
            of.shadow_share,
            of.flicker,
            row.cpu_secs_per_1000_frames
        );
    }
    text
}

impl Corpus {
    pub(super) fn run(&self) -> Result<()> {
        let mut found = sequences(&self.folder, "", GREATEST_DEPTH)?;
        let folder = self.folder.display();
        if found.len() == 1 && found[0].name.is_empty() {
            found[0].name = self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        }
        if let Some(unknown) = self.only.iter().find(|only| found.iter().all(|of| of.name != **only)) {
            let names: Vec<&str> = found.iter().map(|of| of.name.as_str()).collect();
            bail!("{folder} has no sequence {unknown}; there are: {}", names.join(", "));
        }
        found.retain(|of| self.only.is_empty() || self.only.contains(&of.name));
        ensure!(
            !found.is_empty(),
            "{folder} holds no sequence: a folder with input/, groundtruth/ and temporalROI.txt"
        );
        let mut rows = Vec::new();
        for sequence in &found {
            complain(&format!("scoring {}", sequence.name));
            rows.push(sequence.score(&self.set)?);
            if let Some(python) = &self.python {
                rows.extend(sequence.peers(python)?);
            }
        }
        let means = means(&rows);
        let all = [rows, means].concat();
        if let Some(path) = &self.json {
            let text = serde_json::to_string_pretty(&all)? + "\n";
            std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        write!(std::io::stdout().lock(), "{}", table(&all))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_counted_by_truth_and_what_is_not_scored_is_left_out() {
        let truth = [255, 255, 255, 0, 50, 0, OUTSIDE, UNKNOWN];
        let labels = [MOVING, SHADOW, 0, MOVING, SHADOW, 0, MOVING, MOVING];
        let mut counts = Counts::default();
        counts.add((&labels, &truth), None);
        let expected = Counts { hit: 1, false_: 1, missed: 2, clear: 2, shadowed: 1, ..Counts::default() };
        assert_eq!(counts, expected);
        let scores = counts.scores();
        assert!((scores.precision - 0.5).abs() < 1e-12 && (scores.recall - 1.0 / 3.0).abs() < 1e-12);
        assert!((scores.f - 0.4).abs() < 1e-12);
        assert!((scores.false_positive_rate - 1.0 / 3.0).abs() < 1e-12);
        assert!((scores.shadow_share - 1.0 / 3.0).abs() < 1e-12);
        // The first pixel turned, the second's truth did; two have no verdict before or now.
        let earlier = ([0, 0, 0, MOVING, 0, 0, 0, 0], [255, 0, 255, 0, 0, UNKNOWN, 0, 0]);
        let mut counts = Counts::default();
        counts.add((&labels, &truth), Some((&earlier.0, &earlier.1)));
        assert_eq!((counts.steady, counts.turned), (4, 1));
    }

    #[test]
    fn nothing_scored_gives_numbers() {
        let scores = Counts::default().scores();
        assert_eq!((scores.f, scores.flicker, Scores::mean(&[]).f), (0.0, 0.0, 0.0));
    }

    #[test]
    fn sequences_are_found_in_their_categories_and_scored() {
        let folder = tempfile::tempdir().unwrap();
        let sequence = folder.path().join("baseline/still");
        for part in ["input", "groundtruth"] {
            std::fs::create_dir_all(sequence.join(part)).unwrap();
        }
        std::fs::write(sequence.join("temporalROI.txt"), "20 30\n").unwrap();
        for number in 1..=30 {
            // A bright square comes at the end.
            let is_there = number > 20;
            let picture = image::RgbImage::from_fn(64, 48, |x, y| {
                let is_in = is_there && (20..40).contains(&x) && (10..30).contains(&y);
                image::Rgb(if is_in { [220, 60, 60] } else { [90, 90, 90] })
            });
            picture.save(sequence.join(format!("input/in{number:06}.png"))).unwrap();
            let truth = image::GrayImage::from_fn(64, 48, |x, y| {
                let is_in = is_there && (20..40).contains(&x) && (10..30).contains(&y);
                image::Luma([if is_in { TRUE_MOVING } else { 0 }])
            });
            truth.save(sequence.join(format!("groundtruth/gt{number:06}.png"))).unwrap();
        }
        let found = sequences(folder.path(), "", GREATEST_DEPTH).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].name, "baseline/still");
        let row = found[0].score(&[]).unwrap();
        assert_eq!(row.n_frames, 30);
        assert!(row.scores.f > 0.9, "{row:?}");
        assert!(sequences(&sequence.join("input"), "", GREATEST_DEPTH).unwrap().is_empty());
    }
}
