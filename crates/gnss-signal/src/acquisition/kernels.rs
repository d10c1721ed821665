//! The two loops around the transform, compiled for AVX2 as well as for the baseline.
//!
//! Both compilations do the same operations in the same order (nothing is contracted), so that
//! they give the same bits.
#![allow(unsafe_code)] // calls of functions compiled for instructions detected at run time

use num_complex::Complex32;

/// `product[k] = block[k] * code[k]`.
pub(super) fn multiply(block: &[Complex32], code: &[Complex32], product: &mut [Complex32]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: AVX2 is there.
        return unsafe { multiply_avx2(block, code, product) };
    }
    multiply_body(block, code, product);
}

/// `power[k] += |values[k]|^2`.
pub(super) fn add_powers(values: &[Complex32], power: &mut [f32]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: AVX2 is there.
        return unsafe { add_powers_avx2(values, power) };
    }
    add_powers_body(values, power);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn multiply_avx2(block: &[Complex32], code: &[Complex32], product: &mut [Complex32]) {
    multiply_body(block, code, product);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_powers_avx2(values: &[Complex32], power: &mut [f32]) {
    add_powers_body(values, power);
}

#[inline(always)]
fn multiply_body(block: &[Complex32], code: &[Complex32], product: &mut [Complex32]) {
    for ((product, block), code) in product.iter_mut().zip(block).zip(code) {
        *product = block * code;
    }
}

#[inline(always)]
fn add_powers_body(values: &[Complex32], power: &mut [f32]) {
    for (power, value) in power.iter_mut().zip(values) {
        *power += value.norm_sqr();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_compilations_give_the_same_bits() {
        let a: Vec<Complex32> = (0..77)
            .map(|k| Complex32::new((k as f32).sin(), (1.3 * k as f32).cos()))
            .collect();
        let b: Vec<Complex32> = a.iter().rev().map(|v| v * 3.7).collect();
        let mut product = [
            vec![Complex32::default(); 77],
            vec![Complex32::default(); 77],
        ];
        multiply(&a, &b, &mut product[0]);
        multiply_body(&a, &b, &mut product[1]);
        assert_eq!(product[0], product[1]);
        let mut power = [vec![0.5_f32; 77], vec![0.5_f32; 77]];
        add_powers(&a, &mut power[0]);
        add_powers_body(&a, &mut power[1]);
        assert_eq!(power[0], power[1]);
    }
}
