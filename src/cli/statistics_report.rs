//! The table of `--stats`, on standard error.

use sunfleck::render::{RayReport, StatisticsReport};

use super::progress::with_prefix;

/// Prints what was counted.
pub(crate) fn print_statistics(report: &StatisticsReport) {
    table(report).iter().for_each(|line| eprintln!("{line}"));
}

fn table(report: &StatisticsReport) -> Vec<String> {
    let total = report.rays.iter().find(|rays| rays.kind == "all").map_or(0, |all| all.rays);
    let mut lines =
        vec![format!("{:<12}{:>14}{:>9}{:>13}{:>17}", "rays", "count", "share", "nodes/ray", "triangles/ray")];
    lines.extend(report.rays.iter().map(|rays| row(rays, total)));
    if report.rays.iter().all(|rays| rays.nodes.is_none()) {
        lines.push(String::from("what ray queries visit cannot be counted; --trace bvh counts it"));
    }
    let percent = |share: Option<f64>| share.map_or(String::from("-"), |share| format!("{:.1} %", 100.0 * share));
    lines.push(format!(
        "lanes that are busy: {} in the search, {} in shading",
        percent(report.search_occupancy),
        percent(report.shading_occupancy)
    ));
    let slices = &report.slices;
    let resumed = slices.dispatches.saturating_sub(slices.count as u64);
    let [first, shortest, median, longest] =
        [slices.first, slices.shortest, slices.median, slices.longest].map(|seconds| 1e3 * seconds);
    lines.push(format!(
        "{} slices, resumed {resumed} times: median {median:.1} ms, {shortest:.1} to {longest:.1} ms, the first {first:.1} ms",
        slices.count
    ));
    lines
}

fn row(rays: &RayReport, total: u64) -> String {
    let per_ray = |number: Option<f64>| number.map_or(String::from("-"), |n| format!("{n:.2}"));
    format!(
        "  {:<10}{:>14}{:>7.1} %{:>13}{:>17}",
        rays.kind,
        with_prefix(rays.rays as f64).trim_end(),
        100.0 * rays.rays as f64 / (total as f64).max(1.0),
        per_ray(rays.nodes_per_ray),
        per_ray(rays.triangles_per_ray)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunfleck::render::SliceReport;

    fn report(nodes: Option<u64>) -> StatisticsReport {
        let of = |kind, rays: u64| RayReport {
            kind,
            rays,
            nodes,
            triangles: nodes,
            nodes_per_ray: nodes.map(|n| n as f64 / rays as f64),
            triangles_per_ray: nodes.map(|n| n as f64 / rays as f64),
        };
        StatisticsReport {
            rays: vec![of("camera", 1000), of("all", 4000)],
            search_occupancy: Some(0.875),
            shading_occupancy: None,
            slices: SliceReport { count: 3, dispatches: 5, first: 0.5, shortest: 0.25, median: 0.5, longest: 1.0 },
            saturated: false,
        }
    }

    #[test]
    fn the_table_has_every_number() {
        let text = table(&report(Some(2000))).join("\n");
        for part in
            ["1.00 k   25.0 %", "2.00", "0.50", "87.5 % in the search, - in shading", "3 slices, resumed 2 times"]
        {
            assert!(text.contains(part), "{part}:\n{text}");
        }
        assert!(text.contains("median 500.0 ms, 250.0 to 1000.0 ms, the first 500.0 ms"), "{text}");
    }

    #[test]
    fn what_is_not_counted_is_said() {
        let text = table(&report(None)).join("\n");
        assert!(text.contains("cannot be counted") && !text.contains("0.00"), "{text}");
    }
}
