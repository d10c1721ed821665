//! Eight numbers at once: the arithmetic the inner loops are written in, and the instruction sets
//! they run on.
//!
//! Every operation rounds as IEEE 754 says, and products are fused with sums exactly where it says
//! so, so that all instruction sets give the same bits. (Where a processor has no fused product,
//! the portable one is a slow function of the standard library.)
#![allow(unsafe_code)] // AVX2 intrinsics, called only where the processor has them.

use std::ops::{Add, BitAnd, BitXor, Mul, Sub};

/// Numbers in a vector.
pub(super) const LANES: usize = 8;

/// Eight `f32`.
pub(super) trait Floats:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Integers beside them.
    type Words: Words<Floats = Self>;
    fn splat(value: f32) -> Self;
    fn load(values: &[f32; LANES]) -> Self;
    fn store(self, values: &mut [f32; LANES]);
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn over(self, divisor: Self) -> Self;
    /// `self * factor + addend`, rounded once.
    fn fused(self, factor: Self, addend: Self) -> Self;
    fn sqrt(self) -> Self;
    /// The bits of each.
    fn bits(self) -> Self::Words;
}

/// Eight `u32`; sums wrap.
pub(super) trait Words:
    Copy + Add<Output = Self> + Sub<Output = Self> + BitAnd<Output = Self> + BitXor<Output = Self>
{
    /// Numbers beside them.
    type Floats: Floats<Words = Self>;
    fn splat(value: u32) -> Self;
    fn load(values: &[u32; LANES]) -> Self;
    fn left<const N: i32>(self) -> Self;
    fn right<const N: i32>(self) -> Self;
    /// Upper and lower half of each product.
    fn product(self, factor: u32) -> (Self, Self);
    /// The numbers whose bits these are.
    fn as_floats(self) -> Self::Floats;
    /// The values, taken as `i32`.
    fn to_floats(self) -> Self::Floats;
    /// The entry of a table at each index below 8.
    fn pick(self, table: Self::Floats) -> Self::Floats;
}

/// A loop that can run on any vectors; `run` is to be `#[inline(always)]`.
pub(super) trait Kernel {
    fn run<F: Floats>(self);
}

#[cfg(test)]
thread_local! {
    /// Leaves this thread no vectors but those of any processor.
    pub(super) static PORTABLE_ALONE: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs a loop on the widest vectors of this processor.
pub(super) fn run(kernel: impl Kernel) {
    #[cfg(test)]
    if PORTABLE_ALONE.get() {
        return kernel.run::<Portable>();
    }
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: AVX2 and FMA were just found.
        unsafe { avx2::run(kernel) };
        return;
    }
    kernel.run::<Portable>();
}

/// [`Floats`] of any processor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Portable([f32; LANES]);

/// [`Words`] of any processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PortableWords([u32; LANES]);

macro_rules! lane_by_lane {
    ($($of:ident: $operation:ident::$name:ident as $each:expr;)*) => {$(
        impl $operation for $of {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(std::array::from_fn(|k| $each(self.0[k], other.0[k])))
            }
        }
    )*};
}

lane_by_lane! {
    Portable: Add::add as |a: f32, b: f32| a + b;
    Portable: Sub::sub as |a: f32, b: f32| a - b;
    Portable: Mul::mul as |a: f32, b: f32| a * b;
    PortableWords: Add::add as u32::wrapping_add;
    PortableWords: Sub::sub as u32::wrapping_sub;
    PortableWords: BitAnd::bitand as |a: u32, b: u32| a & b;
    PortableWords: BitXor::bitxor as |a: u32, b: u32| a ^ b;
}

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, each: fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|k| each(self.0[k], other.0[k])))
    }
}

impl Floats for Portable {
    type Words = PortableWords;
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn load(values: &[f32; LANES]) -> Self {
        Self(*values)
    }
    #[inline(always)]
    fn store(self, values: &mut [f32; LANES]) {
        *values = self.0;
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        self.with(divisor, |a, b| a / b)
    }
    #[inline(always)]
    fn fused(self, factor: Self, addend: Self) -> Self {
        Self(std::array::from_fn(|k| {
            self.0[k].mul_add(factor.0[k], addend.0[k])
        }))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn bits(self) -> PortableWords {
        PortableWords(self.0.map(f32::to_bits))
    }
}

impl Words for PortableWords {
    type Floats = Portable;
    #[inline(always)]
    fn splat(value: u32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn load(values: &[u32; LANES]) -> Self {
        Self(*values)
    }
    #[inline(always)]
    fn left<const N: i32>(self) -> Self {
        Self(self.0.map(|x| x << N))
    }
    #[inline(always)]
    fn right<const N: i32>(self) -> Self {
        Self(self.0.map(|x| x >> N))
    }
    #[inline(always)]
    fn product(self, factor: u32) -> (Self, Self) {
        let whole = self.0.map(|x| u64::from(x) * u64::from(factor));
        (
            Self(whole.map(|x| (x >> 32) as u32)),
            Self(whole.map(|x| x as u32)),
        )
    }
    #[inline(always)]
    fn as_floats(self) -> Portable {
        Portable(self.0.map(f32::from_bits))
    }
    #[inline(always)]
    fn to_floats(self) -> Portable {
        Portable(self.0.map(|x| x as i32 as f32))
    }
    #[inline(always)]
    fn pick(self, table: Portable) -> Portable {
        Portable(self.0.map(|index| table.0[index as usize % LANES]))
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! Vectors of 256 bits. Values of these types exist only inside [`run`].

    use std::arch::x86_64::*;
    use std::ops::{Add, BitAnd, BitXor, Mul, Sub};

    use super::{Floats, Kernel, LANES, Words};

    /// Runs a loop compiled for AVX2 and FMA.
    ///
    /// # Safety
    /// The processor has both.
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn run(kernel: impl Kernel) {
        kernel.run::<Wide>();
    }

    #[derive(Clone, Copy)]
    pub(super) struct Wide(__m256);

    #[derive(Clone, Copy)]
    pub(super) struct WideWords(__m256i);

    macro_rules! intrinsics {
        ($($of:ident: $operation:ident::$name:ident as $each:ident;)*) => {$(
            impl $operation for $of {
                type Output = Self;
                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    // SAFETY: values exist only where AVX2 and FMA do.
                    Self(unsafe { $each(self.0, other.0) })
                }
            }
        )*};
    }

    intrinsics! {
        Wide: Add::add as _mm256_add_ps;
        Wide: Sub::sub as _mm256_sub_ps;
        Wide: Mul::mul as _mm256_mul_ps;
        WideWords: Add::add as _mm256_add_epi32;
        WideWords: Sub::sub as _mm256_sub_epi32;
        WideWords: BitAnd::bitand as _mm256_and_si256;
        WideWords: BitXor::bitxor as _mm256_xor_si256;
    }

    // SAFETY, of all below: only a loop under `run` asks for these vectors, so that AVX2 and FMA are
    // there; loads and stores take any alignment and stay inside the arrays they are given.
    impl Floats for Wide {
        type Words = WideWords;
        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn load(values: &[f32; LANES]) -> Self {
            Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, values: &mut [f32; LANES]) {
            unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn over(self, divisor: Self) -> Self {
            Self(unsafe { _mm256_div_ps(self.0, divisor.0) })
        }
        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, addend.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Self(unsafe { _mm256_sqrt_ps(self.0) })
        }
        #[inline(always)]
        fn bits(self) -> WideWords {
            WideWords(unsafe { _mm256_castps_si256(self.0) })
        }
    }

    impl Words for WideWords {
        type Floats = Wide;
        #[inline(always)]
        fn splat(value: u32) -> Self {
            Self(unsafe { _mm256_set1_epi32(value as i32) })
        }
        #[inline(always)]
        fn load(values: &[u32; LANES]) -> Self {
            Self(unsafe { _mm256_loadu_si256(values.as_ptr().cast()) })
        }
        #[inline(always)]
        fn left<const N: i32>(self) -> Self {
            Self(unsafe { _mm256_slli_epi32::<N>(self.0) })
        }
        #[inline(always)]
        fn right<const N: i32>(self) -> Self {
            Self(unsafe { _mm256_srli_epi32::<N>(self.0) })
        }
        #[inline(always)]
        fn product(self, factor: u32) -> (Self, Self) {
            unsafe {
                let factor = _mm256_set1_epi32(factor as i32);
                let even = _mm256_mul_epu32(self.0, factor);
                let odd = _mm256_mul_epu32(_mm256_srli_epi64::<32>(self.0), factor);
                let high = _mm256_blend_epi32::<0xAA>(_mm256_srli_epi64::<32>(even), odd);
                let low = _mm256_blend_epi32::<0xAA>(even, _mm256_slli_epi64::<32>(odd));
                (Self(high), Self(low))
            }
        }
        #[inline(always)]
        fn as_floats(self) -> Wide {
            Wide(unsafe { _mm256_castsi256_ps(self.0) })
        }
        #[inline(always)]
        fn to_floats(self) -> Wide {
            Wide(unsafe { _mm256_cvtepi32_ps(self.0) })
        }
        #[inline(always)]
        fn pick(self, table: Wide) -> Wide {
            Wide(unsafe { _mm256_permutevar8x32_ps(table.0, self.0) })
        }
    }
}
