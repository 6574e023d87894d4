//! Published detectors on a real video, the sequence PETS09-S2L1.

use swerve_eval::{AveragePrecision, Found, Recalls};

use crate::acf::{Detection, Overlap, Rung, Scanner, Weights, iou};
use crate::{Rgb, shipped, video::Video};

/// Reference boxes of the frames, as published with the sequence.
fn truth() -> Vec<(usize, [f64; 4])> {
    let path = swerve_tests::data_folder().join("mot15/det/PETS09-S2L1.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.parse().ok()).collect();
        (numbers[0] as usize, [numbers[1], numbers[2], numbers[3], numbers[4]])
    };
    text.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).map(line).collect()
}

/// Average precision over the frames at an overlap of one half.
fn average_precision(weights: Weights, rung: Rung, video: &Video) -> f64 {
    let weights = Weights { overlap: (0.5, Overlap::Union), ..weights };
    let mut scanner = Scanner::new(weights, rung, video.size, None);
    let (truth, mut ap, mut found) = (truth(), AveragePrecision::new(0.5), Vec::<Detection>::new());
    for number in video.numbers() {
        let bytes = video.frame(number);
        scanner.detect(Rgb::new(video.size[0], video.size[1], &bytes).unwrap(), &mut found).unwrap();
        let wanted: Vec<[f64; 4]> =
            truth.iter().filter(|(of, _)| *of == number).map(|(_, bbox)| *bbox).collect();
        let boxes: Vec<Found> = found.iter().map(|d| Found { score: d.score, counts: true }).collect();
        ap.frame(&boxes, &vec![true; wanted.len()], |f, w| iou(found[f].bbox, wanted[w]));
    }
    assert!(ap.wanted() > 150);
    ap.value(Recalls::Coco101).unwrap()
}

#[test]
#[ignore = "OpenCV"]
fn published_models_find_the_people_of_pets() {
    let Some(video) = Video::open(5, 26, 31) else { return };
    let Some(_boxes) = swerve_tests::data_or_skip("mot15/det") else { return };
    for (name, least) in [("acf_inria", 0.82), ("ldcf_inria", 0.82)] {
        let weights = shipped::detector(name).unwrap().unwrap();
        let of = |rung: &Rung| (rung.name.clone(), average_precision(weights.clone(), rung.clone(), &video));
        let found: Vec<(String, f64)> = weights.rungs.iter().map(of).collect();
        println!("{name}: {found:.3?}");
        // The last rung detects people of half the window's height.
        let (rung, value) = found.last().unwrap();
        println!("floor: {name}, rung {rung}, AP50 on vtest.avi: {value:.3} >= {least}");
        assert!(found.len() > 4 && *value >= least, "{name}: {value:.3}, expected at least {least}");
    }
}
