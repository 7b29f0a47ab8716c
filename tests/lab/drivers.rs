//! A second Vulkan driver draws what the first draws: `SwiftShader`, which Debian's chromium brings.

use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use videofields_vision::frame::RgbImage;
use videofields_vision::measures::compare;

/// Where Debian's chromium tells the loader of its driver.
const SECOND_DRIVER: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";

/// Least that a picture of both drivers agrees by: most by 44 dB. Cameras' pictures are noise here, so where they are drawn smaller than
/// they are, the last bit of a place decides which texel is seen; and a dot of the stippled picture is there or not.
fn least_db(name: &str) -> f64 {
    match name {
        "bilinear.png" | "billboards-4-samples.png" => 38.0,
        "stipple.png" => 28.0,
        _ => 44.0,
    }
}

/// The adapter's name and the pictures' names, drawn into `folder`.
fn drawn(folder: &Path, driver: Option<&str>) -> (String, Vec<String>) {
    let mut lab = Command::new(env!("CARGO_BIN_EXE_videofields-lab"));
    lab.args(["drawn", "--out"]).arg(folder);
    if let Some(driver) = driver {
        // The newer name of the variable, and the older one.
        lab.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver);
    }
    let output = lab.output().expect("the program starts");
    assert!(output.status.success(), "{driver:?}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    let mut lines = text.lines();
    let adapter = lines.next().expect("the adapter").to_owned();
    let names = lines.filter_map(|path| Some(Path::new(path).file_name()?.to_str()?.to_owned()));
    (adapter, names.collect())
}

fn read(path: &Path) -> RgbImage {
    let picture = image::open(path).expect("a picture").into_rgb8();
    RgbImage { width: picture.width(), height: picture.height(), data: picture.into_raw() }
}

#[test]
fn ten_pictures_agree_on_a_second_driver() {
    if !Path::new(SECOND_DRIVER).is_file() {
        return videofields_testing::skip_for_want_of_an_adapter(&format!(
            "no second driver at {SECOND_DRIVER}"
        ));
    }
    let folder = TempDir::new().unwrap();
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    let (adapter, names) = drawn(&first, None);
    let (other, others) = drawn(&second, Some(SECOND_DRIVER));
    assert!(other.contains("SwiftShader"), "{other}");
    assert_ne!(adapter, other);
    assert_eq!((names.len(), &names), (10, &others));
    let agree_db = |name: &String| {
        let found = compare(&read(&first.join(name)), &read(&second.join(name)), None).unwrap();
        (name.clone(), found.psnr_db.unwrap_or(f64::INFINITY))
    };
    let found: Vec<(String, f64)> = names.iter().map(agree_db).collect();
    assert!(
        found.iter().all(|(name, psnr_db)| *psnr_db >= least_db(name)),
        "{adapter} and {other} agree by {found:.1?} dB"
    );
}
