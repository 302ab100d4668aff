//! The names that writers give to the methods and parameters of map projections, and the parameters that methods need.

use crate::wkt::comparable_name;

/// The Mercator projection of web maps: of the ellipsoid's coordinates, but by the formulas of the sphere.
pub(crate) const WEB_MERCATOR: &str = "webmerc";

/// The parameters of projections: the name in well-known text, as `comparable_name` spells it, and the name in PROJ.4.
const PARAMETERS: [(&str, &str); 45] = [
    ("centralmeridian", "lon_0"),
    ("longitudeofcenter", "lon_0"),
    ("longitudeoforigin", "lon_0"),
    ("longitudeofnaturalorigin", "lon_0"),
    ("longitudeoffalseorigin", "lon_0"),
    ("longitudeofprojectioncentre", "lon_0"),
    ("longitudeofprojectioncenter", "lon_0"),
    ("straightverticallongitudefrompole", "lon_0"),
    ("latitudeoforigin", "lat_0"),
    ("latitudeofcenter", "lat_0"),
    ("latitudeofnaturalorigin", "lat_0"),
    ("latitudeoffalseorigin", "lat_0"),
    ("latitudeofprojectioncentre", "lat_0"),
    ("latitudeofprojectioncenter", "lat_0"),
    ("standardparallel1", "lat_1"),
    ("latitudeof1ststandardparallel", "lat_1"),
    ("latitudeofstandardparallel", "lat_1"),
    ("standardparallel2", "lat_2"),
    ("latitudeof2ndstandardparallel", "lat_2"),
    ("scalefactor", "k_0"),
    ("scalefactoratnaturalorigin", "k_0"),
    ("scalefactoratprojectioncentre", "k_0"),
    ("scalefactoronpseudostandardparallel", "k_0"),
    ("scalefactoroninitialline", "k_0"),
    ("scalefactorontheinitialline", "k_0"),
    ("falseeasting", "x_0"),
    ("eastingatfalseorigin", "x_0"),
    ("eastingatprojectioncentre", "x_0"),
    ("falsenorthing", "y_0"),
    ("northingatfalseorigin", "y_0"),
    ("northingatprojectioncentre", "y_0"),
    ("azimuth", "alpha"),
    ("azimuthofinitialline", "alpha"),
    ("azimuthattheprojectioncentre", "alpha"),
    ("azimuthatprojectioncentre", "alpha"),
    ("colatitudeofconeaxis", "alpha"),
    ("rectifiedgridangle", "gamma"),
    ("anglefromrectifiedtoskewgrid", "gamma"),
    ("xyplanerotation", "gamma"),
    ("pseudostandardparallel1", "lat_pseudo"),
    ("latitudeofpseudostandardparallel", "lat_pseudo"),
    ("height", "h_0"),
    ("projectionplaneoriginheight", "h_0"),
    ("xscale", "x_scale"),
    ("yscale", "y_scale"),
];

/// The methods of projections: the name in well-known text and the name in PROJ.4, or one of that kind.
const METHODS: [(&str, &str); 52] = [
    ("transversemercator", "tmerc"),
    ("transversemercator3d", "tmerc"),
    ("gausskruger", "tmerc"),
    ("lambertconformalconic2sp", "lcc"),
    ("lambertconicconformal2sp", "lcc"),
    ("lambertconformalconic2spbelgium", "lcc belgium"),
    ("lambertconicconformal2spbelgium", "lcc belgium"),
    ("lambertconformalconic1sp", "lcc"),
    ("lambertconicconformal1sp", "lcc"),
    ("lambertconformalconic", "lcc"),
    ("albersconicequalarea", "aea"),
    ("albersequalarea", "aea"),
    ("albers", "aea"),
    ("lambertazimuthalequalarea", "laea"),
    ("obliquestereographic", "sterea"),
    ("doublestereographic", "sterea"),
    ("polarstereographic", "stere"),
    ("polarstereographicvarianta", "stere"),
    ("polarstereographicvariantb", "stere"),
    ("stereographicnorthpole", "stere"),
    ("stereographicsouthpole", "stere"),
    ("stereographic", "stere"),
    ("mercator", "merc"),
    ("mercator1sp", "merc"),
    ("mercator2sp", "merc"),
    ("mercatorvarianta", "merc"),
    ("mercatorvariantb", "merc"),
    ("mercatorauxiliarysphere", WEB_MERCATOR),
    ("popularvisualisationpseudomercator", WEB_MERCATOR),
    ("transversemercatorsouthorientated", "tmerc south"),
    ("cassinisoldner", "cass"),
    ("cassini", "cass"),
    ("krovak", "krovak"),
    ("krovaknorthorientated", "krovak"),
    ("polyconic", "poly"),
    ("americanpolyconic", "poly"),
    ("hotineobliquemercatorvarianta", "omerc origin"),
    ("hotineobliquemercator", "omerc origin"),
    ("hotineobliquemercatorazimuthnaturalorigin", "omerc origin"),
    ("rectifiedskeworthomorphicnaturalorigin", "omerc origin"),
    ("hotineobliquemercatorazimuthcenter", "omerc centre"),
    ("hotineobliquemercatorvariantb", "omerc centre"),
    ("obliquemercator", "omerc centre"),
    ("rectifiedskeworthomorphiccenter", "omerc centre"),
    ("localorthographic", "ortho"),
    ("local", "ortho"),
    ("colombiaurban", "col_urban"),
    ("igacplanocartesiano", "col_urban"),
    ("equirectangular", "eqc"),
    ("equidistantcylindrical", "eqc"),
    ("cylindricalequalarea", "cea"),
    ("lambertcylindricalequalarea", "cea"),
];

/// The parameters without which nobody knows where a method has its origin. One of the names in each inner list is enough. False eastings and northings are 0 and scales are 1 where a text leaves them out, as the standard says.
pub(crate) const ORIGINS: [(&str, &[&[&str]]); 14] = [
    ("tmerc", &[&["lon_0"], &["lat_0"]]),
    ("tmerc south", &[&["lon_0"], &["lat_0"]]),
    ("lcc", &[&["lon_0"], &["lat_0"]]),
    ("aea", &[&["lon_0"], &["lat_0"], &["lat_1"]]),
    ("laea", &[&["lon_0"], &["lat_0"]]),
    ("sterea", &[&["lon_0"], &["lat_0"]]),
    ("stere", &[&["lon_0"], &["lat_0", "lat_1"]]),
    ("merc", &[&["lon_0"]]),
    (WEB_MERCATOR, &[&["lon_0"]]),
    ("cass", &[&["lon_0"], &["lat_0"]]),
    ("poly", &[&["lon_0"], &["lat_0"]]),
    ("krovak", &[&["lon_0"], &["lat_0"]]),
    ("omerc origin", &[&["lon_0"], &["lat_0"], &["alpha"]]),
    ("omerc centre", &[&["lon_0"], &["lat_0"], &["alpha"]]),
];

/// The parameters that methods need whose names say that they have them.
pub(crate) const PARALLELS: [(&str, &[&str]); 5] = [
    ("lambertconformalconic2sp", &["lat_1", "lat_2"]),
    ("lambertconicconformal2sp", &["lat_1", "lat_2"]),
    ("mercator2sp", &["lat_1"]),
    ("mercatorvariantb", &["lat_1"]),
    ("polarstereographicvariantb", &["lat_1"]),
];

/// Returns the PROJ.4 name of a method of well-known text.
pub(crate) fn method(name: &str) -> Option<&'static str> {
    let name = comparable_name(name);
    METHODS.iter().find(|(long, _)| *long == name).map(|(_, short)| *short)
}

/// Returns the PROJ.4 name of a parameter of well-known text.
pub(crate) fn parameter(name: &str) -> Option<&'static str> {
    let name = comparable_name(name);
    PARAMETERS.iter().find(|(long, _)| *long == name).map(|(_, short)| *short)
}
