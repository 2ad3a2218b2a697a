//! Axis-aligned boxes.

use glam::{DAffine3, DVec3, Vec3};

/// A closed axis-aligned box; empty if `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around points.
    pub fn around(points: impl IntoIterator<Item = [f32; 3]>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, point| {
            let point = Vec3::from(point);
            Self { min: bounds.min.min(point), max: bounds.max.max(point) }
        })
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it contains nothing.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Half the surface area; at most +∞, whatever the extent.
    pub fn half_area(&self) -> f32 {
        let size = self.max - self.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Whether it contains all of `other`.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }

    /// The same in f64.
    pub fn to_f64(self) -> DBounds {
        DBounds { min: self.min.as_dvec3(), max: self.max.as_dvec3() }
    }
}

/// A closed axis-aligned box in f64; empty if `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DBounds {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl DBounds {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Whether it contains nothing.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Centre; zero of an empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { 0.5 * self.min + 0.5 * self.max }
    }

    /// Half the extent; zero of an empty box.
    pub fn half_extent(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { 0.5 * self.max - 0.5 * self.min }
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Grown on every side.
    #[must_use]
    pub fn widened(self, by: DVec3) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    /// The box of the transformed box (Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems 1990).
    #[must_use]
    pub fn transformed(self, transform: &DAffine3) -> Self {
        if self.is_empty() {
            return self;
        }
        let center = transform.transform_point3(self.center());
        let half = self.half_extent();
        let m = transform.matrix3;
        let extent = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        Self { min: center - extent, max: center + extent }
    }

    /// The point of the box nearest to `point`; zero of an empty box.
    pub fn nearest(&self, point: DVec3) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { point.max(self.min).min(self.max) }
    }

    /// The smallest f32 box that contains it.
    pub fn outward(self) -> Bounds {
        let below = |x: f64| {
            let y = x as f32;
            if f64::from(y) > x { y.next_down() } else { y }
        };
        let above = |x: f64| {
            let y = x as f32;
            if f64::from(y) < x { y.next_up() } else { y }
        };
        Bounds {
            min: Vec3::new(below(self.min.x), below(self.min.y), below(self.min.z)),
            max: Vec3::new(above(self.max.x), above(self.max.y), above(self.max.z)),
        }
    }
}
