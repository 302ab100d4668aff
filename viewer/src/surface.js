// How the terrain looks: one shader for all ways of colouring it. Colours and lights are reckoned in the frame of the glTF scene, whose
// y is the height in the source, wherever on the globe a tile lies. Where a scene follows the curve of the earth, `lift` is taken off.
import { Color, DoubleSide, MathUtils, Matrix3, Matrix4, ShaderMaterial, Vector3 } from 'three';

export const MODES = ['points', 'height', 'slope', 'levels', 'images'];

// Ends of the ramps are told apart also by people who see few colours.
export const HEIGHT_COLORS = ['#30123b', '#3f6fd8', '#1bc8c4', '#7ee04a', '#f3c63a', '#e4572a'];
export const SLOPE_COLORS = ['#f7f4e6', '#f2dc8f', '#f0ab4f', '#dd6a3d', '#a8324f', '#4b1d5c'];
export const STEEPEST_DEGREES = 60;
// From the coarsest level on. The exact tiles have a colour of their own.
export const LEVEL_COLORS = ['#e15759', '#f28e2b', '#edc948', '#59a14f', '#4e79a7', '#b07aa1', '#9c755f', '#ff9da7'];
export const EXACT_COLOR = '#c9d3dc';
// As the class water has it.
export const WATER_COLOR = '#4884cc';
// Triangles between vertices of water that are steeper (rise over run) are a bank, not water.
const STEEPEST_WATER = 1;
// Edges are plain where triangles have this many pixels on the screen, the second number, and fade away with the distance down to the first one.
const EDGE_PIXELS = [3, 12];

// The light on level ground is 1 under the default sun, and comes from three places: the sun, the sky, and two faint lights beside the sun. Those
// two let slopes in shadow keep their form.
const [DIRECT, SKY, BESIDE] = [0.62, 0.23, 0.15];
// A sun that is lower than this leaves level ground darker, as in the evening.
const LOWEST_FULL_SUN = 0.45;

const linear = (colors) => colors.map((color) => new Color(color));

// Returns the direction to the sun in the scene: x east, y up, z south. Degrees from north to the east, and above the horizon.
export function sunDirection(azimuth, altitude) {
  const [turn, rise] = [MathUtils.degToRad(azimuth), MathUtils.degToRad(altitude)];
  return new Vector3(Math.sin(turn) * Math.cos(rise), Math.sin(rise), -Math.cos(turn) * Math.cos(rise));
}

const VERTEX = `
uniform mat4 toScene;
uniform mat3 toSceneNormal;
varying float height;
varying vec3 place;
varying vec3 upright;
varying vec3 pointColor;
uniform vec3 plainColor;
#ifdef HAS_WATER
  attribute float water;
  varying float waterShare;
#endif
#ifdef HAS_COLORS
  attribute vec3 color;
#endif
#ifdef IS_BENT
  attribute float lift;
#endif
void main() {
  height = (toScene * vec4(position, 1.0)).y;
  #ifdef IS_BENT
    height -= lift;
  #endif
  place = mat3(toScene) * position;
  #ifdef HAS_WATER
    waterShare = water;
  #endif
  #ifdef HAS_NORMALS
    upright = toSceneNormal * normal;
  #endif
  #ifdef HAS_COLORS
    pointColor = color;
  #else
    pointColor = plainColor;
  #endif
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const FRAGMENT = `
uniform int mode;
uniform bool shaded;
uniform vec3 sun;
uniform float relief;
uniform vec2 heightRange;
uniform vec3 heightColors[6];
uniform vec3 slopeColors[6];
uniform vec3 levelColor;
uniform vec3 waterColor;
uniform bool paintsWater;
#ifdef HAS_WATER
  varying float waterShare;
#endif
varying float height;
varying vec3 place;
varying vec3 upright;
varying vec3 pointColor;
vec3 ramp(vec3 colors[6], float share) {
  float at = clamp(share, 0.0, 1.0) * 5.0;
  vec3 color = colors[0];
  for (int i = 1; i < 6; i++) color = mix(color, colors[i], clamp(at - float(i - 1), 0.0, 1.0));
  return color;
}
// Returns the light on a surface with this unit normal, whose slopes are made steeper for the eye.
float lightOn(vec3 up) {
  vec3 normal = normalize(vec3(relief * up.x, up.y, relief * up.z));
  vec2 aside = 0.7071 * normalize(vec2(-sun.z, sun.x));
  float level = max(sun.y, ${LOWEST_FULL_SUN.toFixed(2)});
  float direct = max(dot(normal, sun), 0.0) / level;
  float sky = 0.5 + 0.5 * normal.y;
  float beside = max(dot(normal, vec3(aside.x, 0.7071, aside.y)), 0.0) + max(dot(normal, vec3(-aside.x, 0.7071, -aside.y)), 0.0);
  return ${DIRECT.toFixed(2)} * direct + ${SKY.toFixed(2)} * sky + ${(BESIDE / Math.SQRT2).toFixed(3)} * beside;
}
void main() {
  vec3 face = normalize(cross(dFdx(place), dFdy(place)));
  if (face.y < 0.0) face = -face;
  #ifdef HAS_NORMALS
    vec3 up = normalize(upright);
    if (up.y < 0.0) up = -up;
  #else
    vec3 up = face;
  #endif
  vec3 color = pointColor;
  vec3 lit = up;
  #ifdef HAS_WATER
    // The normal of a vertex on a shore is the mean of the water's and the bank's. So each triangle there has its own.
    up = normalize(mix(up, face, waterShare));
    lit = up;
    if (waterShare > 0.999 && length(face.xz) < ${STEEPEST_WATER.toFixed(2)} * face.y) {
      lit = vec3(0.0, 1.0, 0.0);
      if (paintsWater) color = waterColor;
    }
  #endif
  if (mode == 1) color = ramp(heightColors, (height - heightRange.x) / max(heightRange.y - heightRange.x, 1e-6));
  if (mode == 2) color = ramp(slopeColors, degrees(acos(clamp(up.y, 0.0, 1.0))) / ${STEEPEST_DEGREES.toFixed(1)});
  if (mode == 3) color = levelColor;
  vec4 diffuseColor = vec4(color, 1.0);
  // The plug-in for images puts them in here.
  #include <color_fragment>
  if (mode != 4) diffuseColor.rgb = color;
  // The eye sees ratios of light in encoded colours, as in preview.png: hence the power.
  if (shaded) diffuseColor.rgb *= pow(lightOn(lit), 2.2);
  gl_FragColor = vec4(diffuseColor.rgb, 1.0);
  #include <colorspace_fragment>
}`;

const EDGE_VERTEX = `
uniform float focalPixels;
uniform float spacing;
varying float pixels;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  pixels = focalPixels * spacing / max(-place.z, 1e-6);
  gl_Position = projectionMatrix * place;
}`;

const EDGE_FRAGMENT = `
uniform vec4 edgeColor;
varying float pixels;
void main() {
  float shown = smoothstep(${EDGE_PIXELS.map((value) => value.toFixed(1)).join(', ')}, pixels);
  if (shown < 0.01) discard;
  gl_FragColor = vec4(edgeColor.rgb, edgeColor.a * shown);
}`;

export class Surface {
  constructor() {
    // All materials share these, so that one change is seen everywhere.
    this.shared = {
      mode: { value: 0 },
      shaded: { value: true },
      sun: { value: sunDirection(315, 45) },
      relief: { value: 1 },
      heightRange: { value: [0, 1] },
      heightColors: { value: linear(HEIGHT_COLORS) },
      slopeColors: { value: linear(SLOPE_COLORS) },
      waterColor: { value: new Color(WATER_COLOR) },
      // Colours that were recorded show water as it is.
      paintsWater: { value: false },
    };
    // Pixels of a length that is as far away as it is long.
    this.focalPixels = { value: 1 };
  }

  // Returns the material of the edges of a mesh whose vertices are about `spacing` metres apart.
  edges(spacing) {
    return new ShaderMaterial({
      uniforms: { edgeColor: { value: [0.02, 0.03, 0.05, 0.45] }, focalPixels: this.focalPixels, spacing: { value: spacing } },
      vertexShader: EDGE_VERTEX,
      fragmentShader: EDGE_FRAGMENT,
      wireframe: true,
      transparent: true,
      depthWrite: false,
    });
  }

  // Returns the material of a mesh. `toScene` leads from its own frame to that of its glTF scene.
  material(mesh, toScene, levelColor) {
    const { normal, color, lift, water } = mesh.geometry.attributes;
    return new ShaderMaterial({
      uniforms: {
        ...this.shared,
        toScene: { value: toScene.clone() },
        toSceneNormal: { value: new Matrix3().getNormalMatrix(toScene) },
        plainColor: { value: mesh.material.color.clone() },
        levelColor: { value: new Color(levelColor) },
      },
      defines: { ...(normal && { HAS_NORMALS: '' }), ...(color && { HAS_COLORS: '' }), ...(lift && { IS_BENT: '' }), ...(water && { HAS_WATER: '' }) },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: DoubleSide,
      // So that edges lie in front of their own triangles.
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
  }
}

// Returns the matrix from the frame of `mesh` to that of `scene`, the glTF scene above it.
export function matrixToScene(mesh, scene) {
  const matrix = new Matrix4();
  for (let node = mesh; node !== scene; node = node.parent) {
    node.updateMatrix();
    matrix.premultiply(node.matrix);
  }
  return matrix;
}
