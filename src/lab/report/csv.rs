//! A stage's rows as CSV (RFC 4180): one line a setting, every measure a column.

use std::collections::BTreeSet;
use videofields_picture::plan::CostRow;

/// The table, with a head line.
pub(super) fn table(rows: &[CostRow]) -> String {
    let names: BTreeSet<&str> = rows.iter().flat_map(|row| row.measures.keys().map(String::as_str)).collect();
    let fixed = [
        "knob",
        "value",
        "is_default",
        "median_ms",
        "lower_quartile_ms",
        "upper_quartile_ms",
        "repeats",
        "memory_bytes",
        "error",
    ];
    let mut text =
        fixed.iter().copied().chain(names.iter().copied()).map(quoted).collect::<Vec<_>>().join(",") + "\r\n";
    for row in rows {
        let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
        let time = row.time_ms;
        let mut cells = vec![
            row.knob.clone(),
            row.value.clone(),
            row.is_default.to_string(),
            time.median.to_string(),
            time.lower_quartile.to_string(),
            time.upper_quartile.to_string(),
            time.count.to_string(),
            row.memory_bytes.to_string(),
            number(row.error),
        ];
        cells.extend(names.iter().map(|name| number(row.measures.get(*name).copied())));
        text += &(cells.iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",") + "\r\n");
    }
    text
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_picture::plan::Spread;

    #[test]
    fn every_measure_has_a_column_and_commas_are_quoted() {
        let row = |value: &str, measures: &[(&str, f64)]| CostRow {
            stage: "map".to_owned(),
            knob: "builder".to_owned(),
            value: value.to_owned(),
            is_default: false,
            time_ms: Spread { median: 1.5, lower_quartile: 1.0, upper_quartile: 2.0, count: 3 },
            memory_bytes: 24,
            error: Some(0.25),
            measures: measures.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        };
        let text = table(&[row("a, \"b\"", &[("mean_m", 0.25)]), row("c", &[("worst_m", 2.0)])]);
        assert_eq!(
            text,
            "knob,value,is_default,median_ms,lower_quartile_ms,upper_quartile_ms,repeats,memory_bytes,error,mean_m,worst_m\r\n\
             builder,\"a, \"\"b\"\"\",false,1.5,1,2,3,24,0.25,0.25,\r\n\
             builder,c,false,1.5,1,2,3,24,0.25,,2\r\n"
        );
    }
}
