//! Names of the machine at hand.

use videofields_picture::plan::Machine;

/// Where Linux tells what processor it runs on.
const PROCESSOR_FILE: &str = "/proc/cpuinfo";

/// Keys under which architectures name their processor's model, the most telling first.
const MODEL_KEYS: [&str; 4] = ["model name", "Model", "Hardware", "cpu model"];

/// This machine, with the adapter of that name.
#[must_use]
pub fn machine(adapter: &str) -> Machine {
    let text = std::fs::read_to_string(PROCESSOR_FILE).unwrap_or_default();
    Machine {
        processor: model_in(&text).unwrap_or("unknown").to_owned(),
        n_processors: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        adapter: adapter.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        build: if cfg!(debug_assertions) { "debug" } else { "release" }.to_owned(),
    }
}

/// What tells one machine's tables from another's: SHA-256 of all that [`machine`] names, in hexadecimal.
#[must_use]
pub fn digest(machine: &Machine) -> String {
    let Machine { processor, n_processors, adapter, version, build } = machine;
    let text = [processor, &n_processors.to_string(), adapter, version, build].map(String::as_str).join("\n");
    videofields_recording::store::digest_hex(text.as_bytes())
}

fn model_in(text: &str) -> Option<&str> {
    MODEL_KEYS.iter().find_map(|wanted| {
        text.lines().find_map(|line| {
            let (key, value) = line.split_once(':')?;
            (key.trim() == *wanted && !value.trim().is_empty()).then_some(value.trim())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_s_model_is_found_by_its_key() {
        let intel = "processor\t: 0\nmodel\t\t: 85\nmodel name\t: A Processor @ 2.00GHz\nstepping\t: 3\n";
        assert_eq!(model_in(intel), Some("A Processor @ 2.00GHz"));
        assert_eq!(model_in("processor : 0\nHardware : BCM2835\nModel : Board 4\n"), Some("Board 4"));
        assert_eq!(model_in("model name :\n"), None);
        assert_eq!(model_in(""), None);
    }

    #[test]
    fn another_adapter_or_version_is_another_machine() {
        let here = machine("llvmpipe");
        assert!(here.n_processors >= 1);
        assert_eq!(digest(&here), digest(&machine("llvmpipe")));
        assert_ne!(digest(&here), digest(&machine("another")));
        assert_ne!(digest(&here), digest(&Machine { version: "9.9.9".to_owned(), ..here.clone() }));
        assert_eq!(digest(&here).len(), 64);
    }
}
