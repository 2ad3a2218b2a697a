//! What `--stats` counts: rays and what their searches visit, how full the vectors were, how long slices took.

use serde::Serialize;

use super::slices::SliceOutcome;
use crate::gpu::TraceBackend;
use crate::layout::RayCounters;

/// Counters of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Rays that the camera sends: one a sample, and emission rays.
    pub camera: RayCount,
    /// Rays that go on from a surface.
    pub scattered: RayCount,
    /// Rays that ask whether light arrives. One that looks through panes is a ray for each.
    pub shadow: RayCount,
    /// Steps of searches. A step visits a slot of the BVH (one node, or a leaf's one or two triangles); with geometry that is compiled in,
    /// and with ray queries, it is a whole search.
    pub search: Occupancy,
    /// Shading of what rays have met.
    pub shading: Occupancy,
    /// Seconds of each slice, from its submission or the end of the one before it, whichever is later, to its end.
    pub slice_seconds: Vec<f64>,
    /// Dispatches: a slice, and one more each time that lanes go on with long paths.
    pub dispatches: u64,
    /// Some lane's counter stopped at the largest number: there was more than is said.
    pub is_saturated: bool,
    /// Whether visits can be counted: a driver does not say what its ray queries visit.
    pub counts_visits: bool,
}

/// Rays of a kind, and what their searches visited in all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCount {
    /// Rays.
    pub rays: u64,
    /// Inner nodes and instances visited.
    pub nodes: u64,
    /// Triangles tested. With geometry compiled in every ray tests all triangles (shadow rays to lamps: all that can be in the
    /// way), and there are no nodes.
    pub triangles: u64,
}

/// How full vectors (subgroups) were when they worked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Occupancy {
    /// Lanes that had something to do, over all times that a vector ran.
    pub busy: u64,
    /// Lanes that the vectors had, likewise.
    pub lanes: u64,
}

impl Occupancy {
    fn plus(self, other: Self) -> Self {
        Self { busy: self.busy + other.busy, lanes: self.lanes + other.lanes }
    }

    /// The busy share; `None` if nothing ran.
    pub fn share(&self) -> Option<f64> {
        (self.lanes > 0).then(|| self.busy as f64 / self.lanes as f64)
    }
}

impl RayCount {
    fn add(&mut self, kind: usize, counters: &RayCounters) {
        self.rays += u64::from(counters.rays[kind]);
        self.nodes += u64::from(counters.nodes[kind]);
        self.triangles += u64::from(counters.triangles[kind]);
    }

    fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            nodes: self.nodes + other.nodes,
            triangles: self.triangles + other.triangles,
        }
    }
}

/// What statistics come to, for people and programs. Numbers a ray are null where nothing was counted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticsReport {
    /// By kind: `camera`, `scattered`, `shadow`, `all`.
    pub rays: Vec<RayReport>,
    /// Share of lanes that were busy when a step of a search ran.
    pub search_occupancy: Option<f64>,
    /// Share of lanes that were busy when hits were shaded.
    pub shading_occupancy: Option<f64>,
    /// Slices.
    pub slices: SliceReport,
    /// Counts are too low: a counter stopped at its largest number.
    pub saturated: bool,
}

/// Rays of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RayReport {
    /// `camera`, `scattered`, `shadow` or `all`.
    pub kind: &'static str,
    /// How many.
    pub rays: u64,
    /// Nodes visited in all.
    pub nodes: Option<u64>,
    /// Triangles tested in all.
    pub triangles: Option<u64>,
    /// Nodes a ray.
    pub nodes_per_ray: Option<f64>,
    /// Triangles a ray.
    pub triangles_per_ray: Option<f64>,
}

/// How long slices took, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SliceReport {
    /// How many.
    pub count: usize,
    /// Dispatches, resumed ones included.
    pub dispatches: u64,
    /// The first slice; drivers that compile late do it there.
    pub first: f64,
    /// Shortest.
    pub shortest: f64,
    /// Half of them took less.
    pub median: f64,
    /// Longest.
    pub longest: f64,
}

impl Statistics {
    pub(super) fn new(trace: TraceBackend) -> Self {
        Self { counts_visits: trace == TraceBackend::Bvh, ..Self::default() }
    }

    pub(super) fn add(&mut self, outcome: &SliceOutcome, counters: &[RayCounters]) {
        self.slice_seconds.push(outcome.own_seconds);
        self.dispatches += outcome.dispatches;
        for lane in counters {
            for (kind, count) in [&mut self.camera, &mut self.scattered, &mut self.shadow].into_iter().enumerate() {
                count.add(kind, lane);
            }
            let width = u64::from(lane.vector_width);
            self.search.busy += u64::from(lane.search_steps);
            self.search.lanes += u64::from(lane.search_vectors) * width;
            self.shading.busy += u64::from(lane.shadings);
            self.shading.lanes += u64::from(lane.shading_vectors) * width;
            let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(lane));
            self.is_saturated |= words.contains(&u32::MAX);
        }
    }

    /// Adds what another run of the same kernel has counted.
    pub fn merge(&mut self, other: &Self) {
        self.camera = self.camera.plus(other.camera);
        self.scattered = self.scattered.plus(other.scattered);
        self.shadow = self.shadow.plus(other.shadow);
        self.search = self.search.plus(other.search);
        self.shading = self.shading.plus(other.shading);
        self.slice_seconds.extend_from_slice(&other.slice_seconds);
        self.dispatches += other.dispatches;
        self.is_saturated |= other.is_saturated;
    }

    /// All rays.
    pub fn all(&self) -> RayCount {
        self.camera.plus(self.scattered).plus(self.shadow)
    }

    /// The numbers to show.
    pub fn report(&self) -> StatisticsReport {
        let kinds =
            [("camera", self.camera), ("scattered", self.scattered), ("shadow", self.shadow), ("all", self.all())];
        let mut seconds = self.slice_seconds.clone();
        seconds.sort_by(f64::total_cmp);
        let at = |i: usize| seconds.get(i).copied().unwrap_or(0.0);
        StatisticsReport {
            rays: kinds.into_iter().map(|(kind, count)| self.ray_report(kind, count)).collect(),
            search_occupancy: self.search.share(),
            shading_occupancy: self.shading.share(),
            slices: SliceReport {
                count: seconds.len(),
                dispatches: self.dispatches,
                first: self.slice_seconds.first().copied().unwrap_or(0.0),
                shortest: at(0),
                median: at(seconds.len() / 2),
                longest: at(seconds.len().saturating_sub(1)),
            },
            saturated: self.is_saturated,
        }
    }

    fn ray_report(&self, kind: &'static str, count: RayCount) -> RayReport {
        let counted = |n: u64| self.counts_visits.then_some(n);
        let per_ray = |n: u64| (self.counts_visits && count.rays > 0).then(|| n as f64 / count.rays as f64);
        RayReport {
            kind,
            rays: count.rays,
            nodes: counted(count.nodes),
            triangles: counted(count.triangles),
            nodes_per_ray: per_ray(count.nodes),
            triangles_per_ray: per_ray(count.triangles),
        }
    }
}
