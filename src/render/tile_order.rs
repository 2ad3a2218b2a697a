//! The order of a film's tiles. Tiles that see nothing of the scene stand together: what a vector of lanes renders is then
//! alike, so that none runs the code of searching and shading for some lanes and that of the sky for others.

use glam::{DVec3, Vec3};

use crate::layout::{PROJECTION_ORTHOGRAPHIC, RenderConstants, TILE_PIXELS, TILE_WIDTH};
use crate::prepare::bounds::Bounds;

/// Tiles of both kinds alternate in runs, so that equal slices of a film take about as long: of both together at least so
/// many, and of the rarer kind too.
const TILES_OF_A_ROUND: usize = 64;
const LEAST_TILES_OF_A_RUN: usize = 16;

/// The tiles of a film in the order in which they are rendered.
#[derive(Clone, Debug)]
pub(super) struct TileOrder {
    /// Tiles of a row.
    across: u32,
    /// Their numbers, row by row.
    tiles: Vec<u32>,
}

impl TileOrder {
    /// For the camera and the film of `constants`. `cover`: boxes that together contain the scene. Where they lie on the film
    /// is not exact (a lens blurs them): a tile that is taken for the other kind is rendered all the same.
    pub(super) fn new(constants: &RenderConstants, cover: &[Bounds]) -> Self {
        let (across, down) = (constants.width.div_ceil(TILE_WIDTH), constants.height.div_ceil(TILE_WIDTH));
        let seen = Coverage::of(constants, cover, across as usize, down as usize).tiles();
        let (some, none): (Vec<u32>, Vec<u32>) = (0..across * down).partition(|&tile| seen[tile as usize]);
        Self { across, tiles: alternate(&some, &none) }
    }

    /// Pixels of all tiles, also of what is outside of the film.
    pub(super) fn pixels(&self) -> u64 {
        self.tiles.len() as u64 * u64::from(TILE_PIXELS)
    }

    /// The pixel at a place in the order.
    pub(super) fn pixel(&self, place: u64) -> (u32, u32) {
        let pixels = u64::from(TILE_PIXELS);
        let (tile, inside) = (self.tiles[(place / pixels) as usize], (place % pixels) as u32);
        let x = tile % self.across * TILE_WIDTH + inside % TILE_WIDTH;
        (x, tile / self.across * TILE_WIDTH + inside / TILE_WIDTH)
    }

    /// The place of a pixel.
    pub(super) fn place(&self, x: u32, y: u32) -> u32 {
        let tile = y / TILE_WIDTH * self.across + x / TILE_WIDTH;
        let position = self.tiles.iter().position(|&other| other == tile).unwrap_or(0);
        position as u32 * TILE_PIXELS + y % TILE_WIDTH * TILE_WIDTH + x % TILE_WIDTH
    }

    /// The tiles of `atoms` atoms from a place on; behind the last tile comes the first.
    pub(super) fn tiles_from(&self, place: u32, atoms: u32) -> impl Iterator<Item = u32> + use<'_> {
        let (first, end) =
            (place / TILE_PIXELS, (u64::from(place) + u64::from(atoms)).div_ceil(u64::from(TILE_PIXELS)));
        self.tiles.iter().copied().cycle().skip(first as usize).take(end as usize - first as usize)
    }
}

/// Both lists in their order, in runs of which each round has its share.
fn alternate(some: &[u32], none: &[u32]) -> Vec<u32> {
    let rarer = some.len().min(none.len());
    if rarer == 0 {
        return [some, none].concat();
    }
    let rounds = ((some.len() + none.len()) / TILES_OF_A_ROUND).min(rarer / LEAST_TILES_OF_A_RUN).max(1);
    let run = |tiles: &[u32], round: usize| tiles.len() * round / rounds..tiles.len() * (round + 1) / rounds;
    (0..rounds).flat_map(|round| [&some[run(some, round)], &none[run(none, round)]].concat()).collect()
}

/// How many rectangles lie on each tile, by their corners: the sum over all tiles above and to the left is the count.
struct Coverage {
    across: usize,
    corners: Vec<i32>,
}

impl Coverage {
    fn of(constants: &RenderConstants, cover: &[Bounds], across: usize, down: usize) -> Self {
        let mut coverage = Self { across, corners: vec![0; (across + 1) * (down + 1)] };
        for rectangle in cover.iter().filter_map(|bounds| rectangle(constants, bounds)) {
            let [x, y] = [0, 1].map(|axis| {
                let tiles = [across, down][axis];
                let tile = |pixel: f64| (pixel / f64::from(TILE_WIDTH)).floor().clamp(-1.0, tiles as f64) as i64;
                (tile(rectangle[axis].0).max(0) as usize, (tile(rectangle[axis].1) + 1).min(tiles as i64) as usize)
            });
            if x.0 < x.1 && y.0 < y.1 {
                coverage.corners[y.0 * (across + 1) + x.0] += 1;
                coverage.corners[y.0 * (across + 1) + x.1] -= 1;
                coverage.corners[y.1 * (across + 1) + x.0] -= 1;
                coverage.corners[y.1 * (across + 1) + x.1] += 1;
            }
        }
        coverage
    }

    /// Whether something lies on each tile.
    fn tiles(self) -> Vec<bool> {
        let mut above = vec![0; self.across + 1];
        let mut tiles = Vec::with_capacity(self.corners.len());
        for row in self.corners.chunks_exact(self.across + 1) {
            let mut sum = 0;
            for (corner, above) in row.iter().zip(&mut above) {
                sum += corner;
                *above += sum;
            }
            tiles.extend(above[..self.across].iter().map(|&count| count > 0));
        }
        tiles
    }
}

/// Where a box is on the film, in pixels: least and largest x, then y. `None`: it is behind the camera.
fn rectangle(constants: &RenderConstants, bounds: &Bounds) -> Option<[(f64, f64); 2]> {
    const EVERYWHERE: [(f64, f64); 2] = [(f64::NEG_INFINITY, f64::INFINITY); 2];
    let axis = |axis: [f32; 3]| Vec3::from(axis).as_dvec3();
    let (right, up) = (axis(constants.camera_right), axis(constants.camera_up));
    let (origin, forward) = (axis(constants.camera_origin), axis(constants.camera_forward));
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let mut corners = 0;
    let mut rectangle = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for corner in 0..8 {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
        let offset = DVec3::new(pick(0), pick(1), pick(2)) - origin;
        let depth = offset.dot(forward);
        let scale = if constants.projection == PROJECTION_ORTHOGRAPHIC { 1.0 } else { depth };
        if depth <= 0.0 {
            continue;
        }
        corners += 1;
        let film = [offset.dot(right) / right.length_squared(), -offset.dot(up) / up.length_squared()];
        for ((value, size), (least, largest)) in
            film.into_iter().zip([constants.width, constants.height]).zip(&mut rectangle)
        {
            let pixel = (value / scale + 1.0) * 0.5 * f64::from(size);
            if pixel.is_nan() {
                return Some(EVERYWHERE);
            }
            (*least, *largest) = (least.min(pixel), largest.max(pixel));
        }
    }
    match corners {
        0 => None,
        8 => Some(rectangle),
        _ => Some(EVERYWHERE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::PROJECTION_PERSPECTIVE;

    /// A camera at the origin that looks down −Z, with a right angle of view.
    fn constants(width: u32, height: u32) -> RenderConstants {
        RenderConstants {
            width,
            height,
            camera_right: [1.0, 0.0, 0.0],
            camera_up: [0.0, 1.0, 0.0],
            camera_forward: [0.0, 0.0, -1.0],
            projection: PROJECTION_PERSPECTIVE,
            ..RenderConstants::default()
        }
    }

    fn cube(center: [f32; 3], half: f32) -> Bounds {
        Bounds { min: Vec3::from(center) - half, max: Vec3::from(center) + half }
    }

    #[test]
    fn a_pixel_is_at_the_place_that_it_is_found_by() {
        let order = TileOrder::new(&constants(211, 93), &[cube([0.0, 0.0, -8.0], 1.0)]);
        assert!(!order.tiles.is_sorted());
        for (x, y) in [(0, 0), (7, 7), (8, 0), (210, 92), (100, 50)] {
            assert_eq!(order.pixel(u64::from(order.place(x, y))), (x, y));
        }
        let mut places: Vec<_> = (0..order.pixels()).map(|place| order.pixel(place)).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), 27 * 12 * 64);
    }

    #[test]
    fn tiles_that_see_a_box_are_told_from_those_that_do_not() {
        let seen = |cover: &[Bounds]| Coverage::of(&constants(64, 64), cover, 8, 8).tiles();
        let count = |cover: &[Bounds]| seen(cover)[..64].iter().filter(|&&tile| tile).count();
        // From 28.4 to 35.6 pixels in both directions, and from 0 to 3.5 across and 3.2 to 64 down.
        let middle = cube([0.0, 0.0, -10.0], 1.0);
        assert_eq!(count(&[middle]), 4);
        assert!([27, 28, 35, 36].iter().all(|&tile| seen(&[middle])[tile]));
        assert_eq!(count(&[Bounds { min: Vec3::new(-2.0, -1.0, -1.01), max: Vec3::new(-0.9, 0.9, -1.0) }]), 8);
        // Behind the camera, beside the film, and around the camera.
        assert_eq!(count(&[cube([0.0, 0.0, 10.0], 1.0)]), 0);
        assert_eq!(count(&[cube([30.0, 0.0, -10.0], 1.0)]), 0);
        assert_eq!(count(&[cube([0.0, 0.0, 0.0], 1.0)]), 64);
        assert_eq!(count(&[cube([f32::NAN, 0.0, -10.0], 1.0)]), 64);
    }

    #[test]
    fn runs_of_both_kinds_alternate() {
        let (some, none): (Vec<u32>, Vec<u32>) = ((0..100).collect(), (100..1000).collect());
        let order = alternate(&some, &none);
        assert_eq!(order.len(), 1000);
        // Six rounds, so that none has fewer than 16 of the rarer kind.
        let first = |tile: u32| order.iter().position(|&other| other == tile);
        assert_eq!([first(0), first(16), first(100)], [Some(0), Some(166), Some(16)]);
        assert_eq!(alternate(&some, &[]), some);
        assert_eq!(alternate(&[1], &[0, 2]), [1, 0, 2]);
    }
}
