//! The colours of pages, charts and pictures.
//!
//! `static/style.css` and `static/lab.css` declare the same colours under the same names as custom
//! properties; a test compares them.

/// A colour of the design, or any other colour. It can have different values on light and dark
/// backgrounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    /// Name of the colour's custom property in the style sheet, without the dashes. `None` for a colour
    /// that is not part of the design.
    pub name: Option<&'static str>,
    /// Red, green and blue on a light background.
    pub light: [u8; 3],
    /// Red, green and blue on a dark background.
    pub dark: [u8; 3],
}

/// A colour with an opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// The colour.
    pub colour: Colour,
    /// Opacity, from 0 to 1.
    pub opacity: f64,
}

const fn rgb(hex: u32) -> [u8; 3] {
    [(hex >> 16) as u8, (hex >> 8) as u8, hex as u8]
}

const fn named(name: &'static str, light: u32, dark: u32) -> Colour {
    Colour { name: Some(name), light: rgb(light), dark: rgb(dark) }
}

/// Background of charts.
pub const SURFACE: Colour = named("surface", 0xff_ffff, 0x1d_2024);
/// Frames and zero lines.
pub const LINE: Colour = named("line", 0xe4_e2dd, 0x30_343a);
/// Grid lines.
pub const GRID: Colour = named("grid", 0xef_edea, 0x21_2429);
/// Text.
pub const TEXT: Colour = named("text", 0x1c_1e22, 0xec_eef1);
/// Secondary text and lines.
pub const MUTED: Colour = named("muted", 0x6a_6d73, 0x9a_a0a8);
/// Highlights.
pub const ACCENT: Colour = named("accent", 0x2d_6fe0, 0x7a_a7ff);
/// The human's vehicle.
pub const HUMAN: Colour = named("human", 0x2d_6fe0, 0x6e_a0ff);
/// The robot's vehicle.
pub const ROBOT: Colour = named("robot", 0xe0_453a, 0xff_6a5e);
/// Predicted regions from the innermost to the outermost: red, yellow, green, blue, purple, as in
/// the paper.
pub const REGIONS: [Colour; 5] = [
    named("region-1", 0xe2_504a, 0xe4_574f),
    named("region-2", 0xe6_bd3c, 0xdf_b73f),
    named("region-3", 0x46_a063, 0x41_9a5e),
    named("region-4", 0x44_77d3, 0x45_76d0),
    named("region-5", 0x93_67cf, 0x86_59c4),
];
/// Predicted regions for colour-blind readers: tones of viridis (van der Walt and Smith 2015) from
/// dark to bright. They also differ in lightness.
pub const SAFE_REGIONS: [Colour; 5] = [
    Colour::rgb(rgb(0x44_0154)),
    Colour::rgb(rgb(0x3b_528b)),
    Colour::rgb(rgb(0x21_918c)),
    Colour::rgb(rgb(0x5e_c962)),
    Colour::rgb(rgb(0xfd_e725)),
];
/// Series in a comparison: blue, vermilion, green, purple, ochre and slate after Okabe and Ito
/// (2008), dark enough for text on a light background. Most people can distinguish them.
pub const SERIES: [Colour; 6] = [
    named("series-1", 0x00_72b2, 0x5c_b8f0),
    named("series-2", 0xc0_5600, 0xf0_a13c),
    named("series-3", 0x00_795a, 0x3f_cf9f),
    named("series-4", 0xa0_347a, 0xe5_8cc6),
    named("series-5", 0x8a_6500, 0xe3_cb52),
    named("series-6", 0x4a_5a78, 0xa9_b8d8),
];
/// The deepest tone of a map.
pub const MAP: Colour = named("map", 0x6a_3fb0, 0xb7_9bf0);

impl Colour {
    /// A colour outside the design, such as a tone of a shaded surface.
    #[must_use]
    pub const fn rgb([red, green, blue]: [u8; 3]) -> Self {
        Self { name: None, light: [red, green, blue], dark: [red, green, blue] }
    }

    /// Interpolates towards another colour by `share` (0 to 1).
    #[must_use]
    pub fn towards(self, other: Self, share: f64) -> Self {
        let mix = |a: [u8; 3], b: [u8; 3]| {
            [0, 1, 2].map(|c| {
                let (a, b) = (f64::from(a[c]), f64::from(b[c]));
                (a + share.clamp(0.0, 1.0) * (b - a)).round() as u8
            })
        };
        Self { name: None, light: mix(self.light, other.light), dark: mix(self.dark, other.dark) }
    }

    /// This colour with an opacity from 0 to 1.
    #[must_use]
    pub const fn at(self, opacity: f64) -> Ink {
        Ink { colour: self, opacity }
    }
}

impl From<Colour> for Ink {
    fn from(colour: Colour) -> Self {
        colour.at(1.0)
    }
}

/// The colour of region `j` (from 0) of `count` regions: red inside, purple outside. Colours are
/// interpolated if there are more regions than colours.
#[must_use]
pub fn region(j: usize, count: usize) -> Colour {
    blend(&REGIONS, j, count)
}

/// Like [`region`], but for colour-blind readers: dark inside, bright outside.
#[must_use]
pub fn safe_region(j: usize, count: usize) -> Colour {
    blend(&SAFE_REGIONS, j, count)
}

fn blend(colours: &[Colour; 5], j: usize, count: usize) -> Colour {
    if count <= colours.len() {
        return colours[j.min(colours.len() - 1)];
    }
    let at = (colours.len() - 1) as f64 * j as f64 / (count - 1) as f64;
    let from = (at as usize).min(colours.len() - 2);
    let share = at - from as f64;
    match share {
        0.0 => colours[from],
        1.0 => colours[from + 1],
        _ => colours[from].towards(colours[from + 1], share),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_style_sheet_has_the_same_colours() {
        // Colours that only charts and the laboratory use are in a separate sheet, which
        // participants do not load.
        let sheets = [
            (include_str!("../../../static/style.css"), "*, *::before"),
            (include_str!("../../../static/lab.css"), ".home"),
        ];
        let parts = sheets.map(|(sheet, after)| {
            let (light, dark) = sheet.split_once("prefers-color-scheme: dark").unwrap();
            (light, dark.split_once(after).unwrap().0)
        });
        let [light, dark] =
            [parts.map(|(light, _)| light).concat(), parts.map(|(_, dark)| dark).concat()];
        let single = [SURFACE, LINE, GRID, TEXT, MUTED, ACCENT, HUMAN, ROBOT, MAP];
        for colour in single.into_iter().chain(REGIONS).chain(SERIES) {
            let name = colour.name.unwrap();
            for (sheet, [r, g, b]) in [(&light, colour.light), (&dark, colour.dark)] {
                let line = format!("--{name}: #{r:02x}{g:02x}{b:02x};");
                assert!(
                    sheet.contains(&line),
                    "static/style.css or static/lab.css: expected {line}"
                );
            }
        }
    }

    #[test]
    fn more_regions_than_colours_are_blends() {
        assert_eq!(
            [region(0, 9), region(4, 9), region(8, 9)],
            [REGIONS[0], REGIONS[2], REGIONS[4]]
        );
        assert_eq!(region(1, 9).light, [0xe4, 0x87, 0x43]);
        assert_eq!(region(2, 3), REGIONS[2]);
    }

    /// Matrices from linear RGB to linear RGB, row by row: normal vision, and vision without the
    /// cones for red, green or blue (Machado, Oliveira and Fernandes 2009, severity 1).
    const VISIONS: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ];

    /// CIE L*, a* and b* of an sRGB colour under a type of vision.
    fn seen(colour: [u8; 3], vision: [[f64; 3]; 3]) -> [f64; 3] {
        let linear = colour.map(|channel| match f64::from(channel) / 255.0 {
            low if low <= 0.040_45 => low / 12.92,
            value => libm::pow((value + 0.055) / 1.055, 2.4),
        });
        let times = |m: [[f64; 3]; 3], v: [f64; 3]| {
            m.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>())
        };
        let rgb = times(vision, linear).map(|channel| channel.clamp(0.0, 1.0));
        // Converts linear RGB to XYZ relative to the D65 white point.
        let to_xyz = [
            [0.4124 / 0.9505, 0.3576 / 0.9505, 0.1805 / 0.9505],
            [0.2126, 0.7152, 0.0722],
            [0.0193 / 1.089, 0.1192 / 1.089, 0.9505 / 1.089],
        ];
        let [x, y, z] = times(to_xyz, rgb).map(|t| match t {
            dark if dark <= 0.008_856 => 7.787 * dark + 16.0 / 116.0,
            bright => libm::cbrt(bright),
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn safe_colours_differ_for_all_eyes() {
        for vision in VISIONS {
            // Neighbours differ in lightness, so they also differ in greyscale print.
            let lightness = SAFE_REGIONS.map(|colour| seen(colour.light, vision)[0]);
            for (inner, outer) in lightness.iter().zip(&lightness[1..]) {
                assert!(outer - inner > 12.0, "{lightness:?}");
            }
            // The lines of the two vehicles.
            for (human, robot) in [(HUMAN.light, ROBOT.light), (HUMAN.dark, ROBOT.dark)] {
                let (human, robot) = (seen(human, vision), seen(robot, vision));
                let apart = human.iter().zip(robot).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
                assert!(apart.sqrt() > 50.0, "{human:?} {robot:?}");
            }
        }
    }
}
