//! Perception of the palette, and all formats of a picture.

use super::color::{self, Color, contrast, graded, luminance};
use super::*;

/// Linear light as perceived with complete colour-vision deficiency (Machado, Oliveira and Fernandes 2009) and without.
const EYES: [(&str, [[f64; 3]; 3]); 3] = [
    ("all colours", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "protanopia",
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    ),
    (
        "deuteranopia",
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    ),
];

/// CIE Lab of linear sRGB under D65.
fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = rgb.map(|part| part.clamp(0.0, 1.0));
    let xyz = [
        (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089,
    ];
    let [x, y, z] = xyz.map(|t| if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn seen(color: Color, by: &[[f64; 3]; 3]) -> [f64; 3] {
    let light = color.0.map(color::linear);
    lab(by.map(|row| row[0] * light[0] + row[1] * light[1] + row[2] * light[2]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Lightness in greyscale print, 0 to 100.
fn lightness(color: Color) -> f64 {
    let y = luminance(color);
    lab([y, y, y])[0]
}

#[test]
fn lines_of_a_plot_differ_to_all_viewers_and_in_grey() {
    for (i, a) in color::SERIES.iter().enumerate() {
        assert!(
            contrast(a.color, color::PAPER) >= 2.9,
            "line {i} on paper: {}",
            contrast(a.color, color::PAPER)
        );
        for (j, b) in color::SERIES.iter().enumerate().take(i).filter(|(_, b)| b.dash == a.dash) {
            for (eyes, by) in EYES {
                let apart = distance(seen(a.color, &by), seen(b.color, &by));
                assert!(apart >= 20.0, "{i} and {j}, {eyes}: {apart:.1}");
            }
            let grey = (lightness(a.color) - lightness(b.color)).abs();
            assert!(grey >= 13.0, "{i} and {j} in grey: {grey:.1}");
        }
        assert!(color::SERIES.iter().skip(i + 1).all(|b| b != a), "line {i} is there twice");
    }
}

#[test]
fn nine_or_more_lines_have_styles_and_repeats_are_noted() {
    let looks: Vec<_> = (0..17).map(color::series).collect();
    for k in 0..16 {
        assert!(looks[..k].iter().all(|before| *before != looks[k]), "line {k}");
    }
    assert_eq!((looks[16], color::looks_repeat(16)), (looks[0], None));
    assert!(color::looks_repeat(17).is_some_and(|note| note.starts_with("17 lines")));
}

#[test]
fn graded_scale_darkens_monotonically_for_all_viewers() {
    for (eyes, by) in EYES {
        let steps: Vec<f64> = (0..=10).map(|k| seen(graded(0.1 * f64::from(k)), &by)[0]).collect();
        assert!(steps.windows(2).all(|pair| pair[0] - pair[1] >= 3.0), "{eyes}: {steps:?}");
        assert!(steps[0] - steps[10] >= 55.0, "{eyes}: {steps:?}");
    }
    for k in 0..=20 {
        let ground = graded(0.05 * f64::from(k));
        let read = contrast(ground, color::ink_on(ground));
        // No background has a contrast of more than 4 with both ink and paper.
        assert!(read >= 3.9, "text at {k}: {read:.2}");
    }
}

/// Elements of the same shape that occur side by side in a picture.
#[test]
fn elements_of_one_shape_differ_to_all_viewers() {
    let fills = [("ego", color::EGO), ("person", color::PERSON), ("vehicle", color::VEHICLE)];
    let lines = [("ego", color::EGO), ("plan", color::PLAN), ("collision", color::ALARM)];
    let dashed = [("fallback", color::FALLBACK), ("sight", color::SIGHT), ("track", color::TRACK)];
    let ends = [("avoided", color::GOOD), ("collision", color::ALARM), ("stopped", color::STOPPED)];
    for group in [fills, lines, dashed, ends] {
        for (i, (name, a)) in group.iter().enumerate() {
            assert!(contrast(*a, color::PAPER) >= 3.0, "{name} on paper: {}", contrast(*a, color::PAPER));
            for (other, b) in &group[..i] {
                for (eyes, by) in EYES {
                    let apart = distance(seen(*a, &by), seen(*b, &by));
                    assert!(apart >= 12.0, "{name} and {other}, {eyes}: {apart:.1}");
                }
            }
        }
    }
    for (name, text) in
        [("ink", color::INK), ("soft", color::SOFT), ("sight", color::SIGHT_TEXT), ("alarm", color::ALARM)]
    {
        assert!(contrast(text, color::PAPER) >= 4.5, "{name}: {}", contrast(text, color::PAPER));
    }
}

fn sample() -> Picture {
    let mut canvas = Canvas::default();
    let axes = Axes { corner: (70.0, 40.0), size: (300.0, 120.0), x: (0.0, 10.0), y: (-1.0, 1.0) };
    axes.ground(&mut canvas);
    axes.grid(&mut canvas, (6.0, 4.0));
    axes.numbers_below(&mut canvas, 6.0);
    axes.numbers_left(&mut canvas, 4.0);
    axes.frame(&mut canvas);
    axes.heading(&mut canvas, "a < b & c, in m/s\u{b2}");
    axes.name_below(&mut canvas, "time (s)");
    axes.name_left(&mut canvas, "lateral", "m");
    canvas.begin_clip(axes.corner, axes.size);
    for (k, look) in color::SERIES.iter().enumerate() {
        let points = (0..=100).map(|i| 0.1 * f64::from(i));
        let wave = points.map(|x| axes.at(x, 0.1 * (k + 1) as f64 * swerve_geom::math::sin(x + k as f64)));
        canvas.path(wave, false, look.line(1.6));
    }
    canvas.end_clip();
    canvas.begin_titled("a box");
    canvas.rect(
        (300.0, 60.0),
        (50.0, 20.0),
        Style::fill(color::EGO).filled_by(0.3).outlined(color::EGO, 1.0).rounded(4.0),
    );
    canvas.end_titled();
    canvas.circle((320.0, 120.0), 9.0, Style::fill(color::PERSON));
    canvas.star((350.0, 120.0), 9.0, Style::fill(color::ALARM));
    canvas.text((325.0, 74.0), "rim", Text { rim: true, bold: true, anchor: Anchor::Middle, ..Text::PLAIN });
    let entries = [
        (Sign::Line(Style::line(color::PLAN, 2.0)), "a line".to_owned()),
        (Sign::Block(Style::fill(color::VEHICLE)), "a block".to_owned()),
        (
            Sign::Mark(|canvas, at| canvas.circle(at, 4.0, Style::fill(color::PLAN))),
            "a mark that needs another line of the legend".to_owned(),
        ),
    ];
    let end = legend(&mut canvas, (20.0, 200.0), 380.0, &entries);
    assert!(end > 200.0, "it is in two lines");
    canvas.finish(400.0, 240.0, "sample (1)")
}

#[test]
fn picture_bytes_are_identical_every_time() {
    for format in Format::ALL {
        let once = sample().bytes(format).unwrap();
        assert!(once == sample().bytes(format).unwrap(), "{format}");
        assert_eq!(
            (Format::of(format!("a.{format}").as_ref()), format.name().parse()),
            (Some(format), Ok(format))
        );
        if let Some(folder) = std::env::var_os("SWERVE_PICTURE_DIR") {
            std::fs::write(std::path::Path::new(&folder).join(format!("sample.{format}")), once).unwrap();
        }
    }
    assert!("gif".parse::<Format>().is_err() && Format::of("a.toml".as_ref()).is_none());
}

#[test]
fn svg_has_only_xml_characters() {
    let text = "a\u{0}b\u{1b}[2J\u{7f}\u{fffe}\n\u{e9}";
    assert_eq!(crate::escape(text), "a\u{fffd}b\u{fffd}[2J\u{fffd}\u{fffd}\n\u{e9}");
}

#[test]
fn svg_escapes_and_names_its_font() {
    let svg = sample().svg();
    assert!(svg.contains("a &lt; b &amp; c") && svg.contains(STACK) && svg.trim_end().ends_with("</svg>"));
    assert_eq!((svg.matches("<g").count(), svg.matches("</g>").count()), (2, 2));
}

#[test]
fn png_has_the_size_and_contents_of_the_picture() {
    let file = sample().bytes(Format::Png).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height, info.color_type), (800, 480, png::ColorType::Rgb));
    let at = |x: usize, y: usize| [0, 1, 2].map(|k| pixels[3 * (800 * y + x) + k]);
    assert_eq!((at(1, 1), at(640, 240)), (color::PAPER.0, color::PERSON.0), "paper, and the circle");
    // The heading has dark pixels, and the area outside it has none.
    let dark = |xs: core::ops::Range<usize>, ys: core::ops::Range<usize>| {
        ys.flat_map(|y| xs.clone().map(move |x| (x, y)))
            .filter(|(x, y)| luminance(Color(at(*x, *y))) < 0.3)
            .count()
    };
    assert!(dark(140..400, 44..68) > 100 && dark(600..800, 20..60) == 0);
    // The clip works: the curves end at the frame.
    assert_eq!(dark(742..800, 90..300), 0);
    let huge = Canvas::default().finish(1e7, 1e7, "");
    assert!(huge.bytes(Format::Png).is_err());
}

/// Every object is at the offset in the file's table; the page has the picture's size, its fonts and its texts.
#[test]
fn pdf_is_readable() {
    let file = sample().bytes(Format::Pdf).unwrap();
    let find = |what: &[u8], from: usize| {
        file[from..].windows(what.len()).position(|part| part == what).map(|at| at + from)
    };
    let text = String::from_utf8_lossy(&file).into_owned();
    let start: usize =
        text.rsplit("startxref").next().unwrap().split_whitespace().next().unwrap().parse().unwrap();
    assert!(file[start..].starts_with(b"xref") && text.trim_end().ends_with("%%EOF"));
    let table = String::from_utf8_lossy(&file[start..]).into_owned();
    let mut used = 0;
    let entries = table.lines().skip(2).take_while(|line| !line.starts_with("trailer"));
    for (id, line) in entries.enumerate().filter(|(_, line)| line.contains(" n")) {
        let at: usize = line.split(' ').next().unwrap().parse().unwrap();
        assert!(file[at..].starts_with(format!("{id} 0 obj").as_bytes()), "object {id} at {at}");
        used += 1;
    }
    assert!(used >= 15, "{used}");
    assert!(text.contains("/MediaBox [0 0 300 180]") && text.contains("/Title "), "no page of this size");
    let stream = |object: &str| {
        let begin = find(object.as_bytes(), 0).unwrap();
        let (from, to) = (find(b"stream\n", begin).unwrap() + 7, find(b"\nendstream", begin).unwrap());
        miniz_oxide::inflate::decompress_to_vec_zlib(&file[from..to]).unwrap()
    };
    let content = String::from_utf8_lossy(&stream("\n4 0 obj")).into_owned();
    let count =
        |operator: &str| content.lines().filter(|line| line.split(' ').next_back() == Some(operator)).count();
    assert_eq!(count("Tj"), sample().texts().count() + 1, "a text with a rim is there twice");
    assert_eq!((count("BT"), count("q")), (count("ET"), count("Q")));
    for (object, font) in [("\n14 0 obj", false), ("\n24 0 obj", true)] {
        assert!(stream(object) == font::Font::of(font).bytes, "the font is whole");
    }
}

#[test]
fn text_width_is_the_sum_of_its_letters() {
    let font = font::Font::of(false);
    assert!(
        (font.width("A\u{a0}b\u{2026}") - (0.667 + 0.278 + 0.556 + 1.0)).abs() < 2e-3,
        "{}",
        font.width("A b\u{2026}")
    );
    assert!(width_of("width", Text { bold: true, ..Text::PLAIN }) > width_of("width", Text::PLAIN));
    // Missing characters are drawn as boxes, which have a width.
    assert!(font.width("\u{4e2d}") > 0.3);
}

#[test]
fn ticks_are_round() {
    assert_eq!([0.9, 7.0, 33.0, 1200.0].map(|range| round_step(range, 5.0)), [0.2, 2.0, 10.0, 500.0]);
    assert_eq!(multiples(-1.0, 1.0, 0.5).collect::<Vec<_>>(), [-1.0, -0.5, 0.0, 0.5, 1.0]);
    assert_eq!([0.0, -0.001, 1.5, 2.0, 0.126].map(number), ["0", "0", "1.5", "2", "0.13"]);
}
