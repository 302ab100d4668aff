//! Projections have the same bits on every machine, and however the compiler optimizes.

use super::ellipsoid::Ellipsoid;
use super::equal_area::{Albers, LambertAzimuthal, LambertCylindrical};
use super::krovak::Krovak;
use super::lambert_conic::LambertConic;
use super::mercator::Mercator;
use super::meridian_arc::{Cassini, Polyconic};
use super::oblique_mercator::ObliqueMercator;
use super::stereographic::{ObliqueStereographic, PolarStereographic};
use super::transverse_mercator::TransverseMercator;

/// A way forward or back.
type Way<'a> = &'a dyn Fn([f64; 2]) -> Option<[f64; 2]>;

/// Mixes the bits of many places on the map, and of the way back from there, into one number.
fn bits(forward: Way, inverse: Way) -> u64 {
    let mut mixed = 0u64;
    for i in 0..2_000 {
        let place = [f64::from(i * 7919 % 1999) * 1e-4 - 0.1, 0.3 + f64::from(i * 104_729 % 1997) * 5e-4];
        let map = forward(place).unwrap();
        for value in map.into_iter().chain(inverse(map).unwrap()) {
            mixed = (mixed.rotate_left(5) ^ value.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }
    mixed
}

fn all_bits() -> [u64; 14] {
    let earth = Ellipsoid::of([6_378_137.0, 6_356_752.314_140_356]).unwrap();
    let transverse = TransverseMercator::new(earth, 0.2, 0.9996);
    let cone = LambertConic::new(earth, 0.7, [0.65, 0.8], 1.0).unwrap();
    let (mercator, web) = (Mercator::new(earth, 0.997), Mercator::web(earth));
    let albers = Albers::new(earth, 0.7, [0.65, 0.8]).unwrap();
    let azimuthal = LambertAzimuthal::new(earth, 0.9);
    let polar = PolarStereographic::with_parallel(earth, 1.2, 1.0);
    let oblique = ObliqueStereographic::new(earth, 0.9, 0.9999).unwrap();
    let cylindrical = LambertCylindrical::new(earth, 0.5).unwrap();
    let [centre, crossing] = [ObliqueMercator::around_centre, ObliqueMercator::around_crossing]
        .map(|new| new(earth, 0.8, [-0.6, -0.61], 0.9996).unwrap());
    let krovak = Krovak::new(earth, 0.86, 0.9999).unwrap();
    let (cassini, polyconic) = (Cassini::new(earth, 0.9), Polyconic::new(earth, 0.0));
    [
        bits(&|place| transverse.forward(place), &|map| transverse.inverse(map)),
        bits(&|place| cone.forward(place), &|map| cone.inverse(map)),
        bits(&|place| mercator.forward(place), &|map| mercator.inverse(map)),
        bits(&|place| web.forward(place), &|map| web.inverse(map)),
        bits(&|place| albers.forward(place), &|map| albers.inverse(map)),
        bits(&|place| azimuthal.forward(place), &|map| azimuthal.inverse(map)),
        bits(&|place| polar.forward(place), &|map| polar.inverse(map)),
        bits(&|place| oblique.forward(place), &|map| oblique.inverse(map)),
        bits(&|place| cylindrical.forward(place), &|map| cylindrical.inverse(map)),
        bits(&|place| centre.forward(place), &|map| centre.inverse(map)),
        bits(&|place| crossing.forward(place), &|map| crossing.inverse(map)),
        bits(&|place| krovak.forward(place), &|map| krovak.inverse(map)),
        bits(&|place| cassini.forward(place), &|map| cassini.inverse(map)),
        bits(&|place| polyconic.forward(place), &|map| polyconic.inverse(map)),
    ]
}

#[test]
fn the_bits_are_those_of_every_machine() {
    let expected = [
        0x7518_28e3_3376_d778,
        0xb64b_7ccf_9be1_4d0b,
        0xdf89_7ce0_1c76_23f4,
        0xe42d_00cc_b182_8b97,
        0xd8b1_488f_86df_ef66,
        0x5307_7429_f12c_8cb0,
        0x37bb_c0e7_447c_b98f,
        0xfa6d_538a_c7bd_35f0,
        0x53aa_1ccd_61b2_ea5a,
        0xdd72_94c3_ea1a_4490,
        0xde32_ef63_1043_ad1e,
        0xe9ae_0320_b2db_dbc6,
        0x61f9_a82a_82ba_4bee,
        0xc1d2_84af_78d5_084a,
    ];
    assert_eq!(all_bits(), expected);
}
