//! Gradients compared with central differences, Adam with its formula, and products with their order of summation.

use swerve_core::Rng;

use super::gradients::check;
use super::*;

fn random(rows: usize, columns: usize, key: i64) -> Matrix {
    let mut rng = Rng::keyed(5, "random", &[key]);
    Matrix::new(rows, columns, (0..rows * columns).map(|_| rng.normal() as f32).collect())
}

/// Half the sum of the squares of a node, as a loss.
fn squares(tape: &Tape<'_>, node: Node) -> (f32, Vec<Matrix>) {
    let value = tape.value(node);
    let sum = 0.5 * value.values.iter().map(|one| one * one).sum::<f32>();
    (sum, tape.back(vec![(node, value.clone())]))
}

#[test]
fn layer_gradients_match_central_differences() {
    let mut shapes = Shapes::default();
    let (first, second) = (shapes.layer(3, 5), shapes.layer(5, 2));
    let weights = drawn(&shapes.list(), 3);
    for bend in 0..4 {
        check(&weights, &|weights| {
            let mut tape = Tape::new(weights);
            let x = tape.given(random(4, 3, 1));
            let y = tape.linear(x, first);
            let y = match bend {
                0 => tape.relu(y),
                1 => tape.tanh(y),
                2 => tape.sigmoid(y),
                _ => tape.rest(y),
            };
            let y = tape.linear(y, second);
            squares(&tape, y)
        });
    }
}

#[test]
fn gradients_of_combined_nodes_match_central_differences() {
    let mut shapes = Shapes::default();
    let (first, second) = (shapes.layer(3, 4), shapes.layer(3, 4));
    let weights = drawn(&shapes.list(), 4);
    check(&weights, &|weights| {
        let mut tape = Tape::new(weights);
        let x = tape.given(random(5, 3, 2));
        let (a, b) = (tape.linear(x, first), tape.linear(x, second));
        let (sum, product) = (tape.sum(a, b), tape.product(a, b));
        let both = tape.beside(&[sum, product, a]);
        let some = tape.columns(both, 2..9);
        let rows = tape.rows(some, vec![4, 0, 0, 2]);
        let largest = tape.largest(rows, &[0..2, 2..2, 2..4]);
        squares(&tape, largest)
    });
}

#[test]
fn recurrent_unit_gradients_match_central_differences() {
    let mut shapes = Shapes::default();
    let unit = shapes.gru(2, 5);
    let weights: Vec<Matrix> = drawn(&shapes.list(), 6)
        .into_iter()
        .enumerate()
        .map(|(k, one)| one.zip(&random(one.rows, one.columns, 90 + k as i64), |a, b| a + 0.3 * b))
        .collect();
    check(&weights, &|weights| {
        let mut tape = Tape::new(weights);
        let mut memory = tape.given(Matrix::zeros(3, 5));
        for k in 0..4 {
            let x = tape.given(random(3, 2, 10 + k));
            memory = tape.gru(x, memory, &unit);
        }
        squares(&tape, memory)
    });
}

#[test]
fn attention_gradients_match_central_differences() {
    let mut shapes = Shapes::default();
    let (asked, keys, values) = (shapes.layer(3, 4), shapes.layer(2, 4), shapes.layer(2, 5));
    let weights = drawn(&shapes.list(), 7);
    check(&weights, &|weights| {
        let mut tape = Tape::new(weights);
        let (x, near) = (tape.given(random(3, 3, 20)), tape.given(random(5, 2, 21)));
        let asked = tape.linear(x, asked);
        let (keys, values) = (tape.linear(near, keys), tape.linear(near, values));
        let found = tape.attended(asked, [keys, values], vec![0..3, 3..3, 3..5]);
        assert!(tape.value(found).row(1).iter().all(|one| *one == 0.0), "nobody near");
        squares(&tape, found)
    });
}

#[test]
fn density_gradients_match_central_differences() {
    let numbers = [0.3, -0.2, 0.5, -0.4, 0.6];
    let at = [0.7, 0.4];
    let normal = |numbers: &[f32]| Normal::of(numbers, [0.1, 0.2], -0.5);
    let gradient = normal(&numbers).gradient(at);
    for k in 0..5 {
        let moved = |by: f32| {
            let mut moved = numbers;
            moved[k] += by;
            normal(&moved).nats(at)
        };
        let slope = (moved(2e-3) - moved(-2e-3)) / 4e-3;
        assert!((slope - gradient[k]).abs() < 5e-3, "{k}: {} against {slope}", gradient[k]);
    }
    // The density in closed form, from the reported covariance.
    let (one, [xx, xy, yy]) = (normal(&numbers), normal(&numbers).covariance());
    let (x, y, det) = (at[0] - one.mean[0], at[1] - one.mean[1], xx * yy - xy * xy);
    let squared = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / det;
    let nats = 0.5 * squared + libm::logf(core::f32::consts::TAU * det.sqrt());
    assert!((one.nats(at) - nats).abs() < 1e-5);
    // The sample without noise is the mean; the standardised residual of a sample is its noise.
    assert_eq!(one.at([0.0; 2]), one.mean);
    let drawn = one.at([1.0, -2.0]);
    let nats = 0.5 * 5.0 + 0.5 * libm::logf(det) + libm::logf(core::f32::consts::TAU);
    assert!((one.nats(drawn) - nats).abs() < 1e-4);
}

#[test]
fn products_are_summed_in_order_for_any_block_size() {
    for [m, k, n] in [[1, 1, 1], [3, 7, 16], [5, 33, 37], [4, 2, 48], [0, 3, 5], [2, 0, 20]] {
        let (a, b) = (random(m, k, 30), random(k, n, 31));
        let product = a.times(&b);
        for row in 0..m {
            for column in 0..n {
                let mut sum = 0.0_f32;
                for j in 0..k {
                    sum += a.row(row)[j] * b.row(j)[column];
                }
                assert_eq!(product.row(row)[column].to_bits(), sum.to_bits(), "{m} {k} {n}: {row} {column}");
            }
        }
    }
}

/// From zero moments, the first step of Adam equals the learning rate for any gradient within the clipping norm.
#[test]
fn adam_steps_match_its_formula() {
    let mut weights = vec![Matrix::zeros(1, 3)];
    let gradients = [Matrix::new(1, 3, vec![0.3, -0.002, 0.0])];
    let mut adam = Adam::new(&weights);
    adam.step(&mut weights, &gradients, 0.01);
    let [a, b, c] = weights[0].values[..] else { panic!() };
    assert!((a + 0.01).abs() < 1e-5 && (b - 0.01).abs() < 1e-4 && c == 0.0, "{weights:?}");
    // Second step by hand: m = 0.9 · 0.1 g1 + 0.1 g2, v likewise, both divided by 1 minus the remaining initial
    // weight.
    adam.step(&mut weights, &[Matrix::new(1, 3, vec![0.1, 0.0, 0.0])], 0.01);
    let m = (0.9 * 0.03 + 0.01) / (1.0 - 0.81);
    let v: f32 = (0.999 * 9e-5 + 1e-5) / (1.0 - 0.998_001);
    assert!((weights[0].values[0] - (a - 0.01 * m / v.sqrt())).abs() < 1e-5);
}
