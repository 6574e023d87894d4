//! Side profiles of cars.

/// One cross-section of a car's profile, as fractions: position along the length from the front, height of the upper
/// edge, height of the belt line, half width.
pub(super) type Section = [f32; 4];

/// Side profile of a car and positions of its glass.
pub(super) struct Profile {
    pub(super) sections: &'static [Section],
    /// Along the length: foot and head of the windscreen, head and foot of the rear window.
    pub(super) screen: [f32; 4],
    /// Along the length: pillars and door gaps.
    pub(super) pillars: &'static [f32],
    /// Along the length: front and rear axle.
    pub(super) axles: [f32; 2],
    /// Fraction of the half width by which the roof is narrower.
    pub(super) tumble_home: f32,
    /// End of the side windows along the length.
    pub(super) glass_end: f32,
    pub(super) wheel_radius_m: f32,
}

pub(super) const SEDAN: Profile = Profile {
    sections: &[
        [0.0, 0.40, 0.40, 0.80],
        [0.012, 0.50, 0.50, 0.88],
        [0.05, 0.575, 0.57, 0.945],
        [0.13, 0.615, 0.60, 0.985],
        [0.27, 0.66, 0.635, 1.0],
        [0.40, 0.945, 0.645, 1.0],
        [0.45, 0.985, 0.645, 1.0],
        [0.53, 1.0, 0.65, 1.0],
        [0.63, 0.985, 0.655, 1.0],
        [0.70, 0.945, 0.66, 1.0],
        [0.83, 0.715, 0.665, 0.99],
        [0.93, 0.69, 0.66, 0.965],
        [0.985, 0.655, 0.64, 0.91],
        [1.0, 0.54, 0.54, 0.86],
    ],
    screen: [0.27, 0.40, 0.70, 0.83],
    pillars: &[0.40, 0.555, 0.70],
    axles: [0.185, 0.79],
    tumble_home: 0.24,
    glass_end: 0.80,
    wheel_radius_m: 0.325,
};

pub(super) const HATCHBACK: Profile = Profile {
    sections: &[
        [0.0, 0.42, 0.42, 0.80],
        [0.012, 0.52, 0.52, 0.88],
        [0.05, 0.585, 0.58, 0.945],
        [0.12, 0.62, 0.61, 0.985],
        [0.24, 0.67, 0.64, 1.0],
        [0.37, 0.94, 0.65, 1.0],
        [0.43, 0.985, 0.65, 1.0],
        [0.55, 1.0, 0.655, 1.0],
        [0.75, 0.985, 0.665, 1.0],
        [0.88, 0.94, 0.675, 0.985],
        [0.965, 0.70, 0.68, 0.95],
        [0.99, 0.60, 0.60, 0.90],
        [1.0, 0.50, 0.50, 0.87],
    ],
    screen: [0.24, 0.37, 0.88, 0.965],
    pillars: &[0.37, 0.56, 0.78],
    axles: [0.19, 0.82],
    tumble_home: 0.22,
    glass_end: 0.90,
    wheel_radius_m: 0.315,
};

pub(super) const SUV: Profile = Profile {
    sections: &[
        [0.0, 0.44, 0.44, 0.84],
        [0.012, 0.54, 0.54, 0.90],
        [0.045, 0.605, 0.60, 0.955],
        [0.12, 0.63, 0.62, 0.99],
        [0.25, 0.67, 0.64, 1.0],
        [0.36, 0.945, 0.65, 1.0],
        [0.42, 0.985, 0.65, 1.0],
        [0.55, 1.0, 0.655, 1.0],
        [0.78, 0.99, 0.665, 1.0],
        [0.93, 0.955, 0.67, 0.985],
        [0.98, 0.70, 0.67, 0.95],
        [0.992, 0.60, 0.60, 0.92],
        [1.0, 0.48, 0.48, 0.90],
    ],
    screen: [0.25, 0.36, 0.93, 0.98],
    pillars: &[0.36, 0.55, 0.76],
    axles: [0.18, 0.80],
    tumble_home: 0.18,
    glass_end: 0.93,
    wheel_radius_m: 0.37,
};

pub(super) const VAN: Profile = Profile {
    sections: &[
        [0.0, 0.30, 0.30, 0.84],
        [0.01, 0.38, 0.38, 0.91],
        [0.04, 0.435, 0.43, 0.96],
        [0.13, 0.49, 0.48, 0.99],
        [0.25, 0.86, 0.50, 1.0],
        [0.31, 0.97, 0.50, 1.0],
        [0.37, 0.995, 0.50, 1.0],
        [0.60, 1.0, 0.50, 1.0],
        [0.97, 0.995, 0.50, 1.0],
        [0.99, 0.96, 0.50, 0.99],
        [1.0, 0.92, 0.50, 0.98],
    ],
    screen: [0.13, 0.25, 1.1, 1.1],
    pillars: &[0.25, 0.38],
    axles: [0.16, 0.80],
    tumble_home: 0.10,
    glass_end: 0.37,
    wheel_radius_m: 0.34,
};
