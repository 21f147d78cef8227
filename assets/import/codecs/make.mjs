// Makes the files of this folder: a small mesh with a texture, plain and through the reference encoders of each
// compression. Run in a folder with
//   npm install @gltf-transform/core @gltf-transform/functions @gltf-transform/extensions \
//       draco3dgltf meshoptimizer ktx2-encoder sharp
// as `node make.mjs FOLDER`; made with versions 4 of glTF Transform, 1.5.7 of Draco, 0.22 or later of meshoptimizer and
// Basis Universal 1.50 or later.
import { Document, NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS } from '@gltf-transform/extensions';
import { draco, meshopt } from '@gltf-transform/functions';
import { ktx2 } from 'ktx2-encoder/gltf-transform';
import draco3d from 'draco3dgltf';
import { MeshoptEncoder, MeshoptDecoder } from 'meshoptimizer';
import sharp from 'sharp';

const folder = process.argv[2];
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.encoder': await draco3d.createEncoderModule(),
  'draco3d.decoder': await draco3d.createDecoderModule(),
  'meshopt.encoder': MeshoptEncoder,
  'meshopt.decoder': MeshoptDecoder,
});
await MeshoptEncoder.ready;

// A grid of 9 x 7 vertices on the paraboloid z = x^2 / 4 - y^2 / 8, in colours, with one texture of smooth colours.
async function plain() {
  const document = new Document();
  const buffer = document.createBuffer();
  const [positions, normals, uvs, colours, indices] = [[], [], [], [], []];
  for (let j = 0; j < 7; j++) {
    for (let i = 0; i < 9; i++) {
      const [x, y] = [i / 4 - 1, j / 3 - 1];
      const normal = [-x / 2, y / 4, 1];
      const length = Math.hypot(...normal);
      positions.push(x, y, (x * x) / 4 - (y * y) / 8);
      normals.push(...normal.map((n) => n / length));
      uvs.push(i / 8, j / 6);
      colours.push(i * 31, j * 42, 128, 255);
      if (i < 8 && j < 6) {
        const a = j * 9 + i;
        indices.push(a, a + 1, a + 10, a, a + 10, a + 9);
      }
    }
  }
  const accessor = (array, type, normalized = false) =>
    document.createAccessor().setArray(array).setType(type).setNormalized(normalized).setBuffer(buffer);
  const size = 16;
  const pixels = Buffer.alloc(size * size * 4);
  for (let y = 0; y < size; y++) {
    for (let x = 0; x < size; x++) {
      pixels.set([x * 17, y * 17, 120, 255 - 4 * x], 4 * (y * size + x));
    }
  }
  const png = await sharp(pixels, { raw: { width: size, height: size, channels: 4 } }).png().toBuffer();
  const texture = document.createTexture('smooth').setImage(png).setMimeType('image/png');
  const material = document.createMaterial('m').setBaseColorTexture(texture).setAlphaMode('BLEND');
  const primitive = document
    .createPrimitive()
    .setAttribute('POSITION', accessor(new Float32Array(positions), 'VEC3'))
    .setAttribute('NORMAL', accessor(new Float32Array(normals), 'VEC3'))
    .setAttribute('TEXCOORD_0', accessor(new Float32Array(uvs), 'VEC2'))
    .setAttribute('COLOR_0', accessor(new Uint8Array(colours), 'VEC4', true))
    .setIndices(accessor(new Uint16Array(indices), 'SCALAR'))
    .setMaterial(material);
  const node = document.createNode('grid').setMesh(document.createMesh().addPrimitive(primitive));
  document.createScene().addChild(node);
  return document;
}

async function write(name, ...transforms) {
  const document = await plain();
  await document.transform(...transforms);
  await io.write(`${folder}/${name}.glb`, document);
}

const imageDecoder = async (bytes) => {
  const { data, info } = await sharp(bytes).ensureAlpha().raw().toBuffer({ resolveWithObject: true });
  return { data: new Uint8Array(data), width: info.width, height: info.height };
};

// WebP without loss, as the extension names it.
async function webp(document) {
  const { EXTTextureWebP } = await import('@gltf-transform/extensions');
  document.createExtension(EXTTextureWebP).setRequired(true);
  for (const texture of document.getRoot().listTextures()) {
    texture.setImage(await sharp(texture.getImage()).webp({ lossless: true, exact: true }).toBuffer());
    texture.setMimeType('image/webp');
  }
}

await write('plain');
await write('webp', webp);
await write('uastc', ktx2({ isUASTC: true, needSupercompression: true, imageDecoder }));
await write('etc1s', ktx2({ isUASTC: false, qualityLevel: 255, compressionLevel: 4, imageDecoder }));
await write('meshopt', meshopt({ encoder: MeshoptEncoder, level: 'high' }));
await write('draco', draco({ method: 'edgebreaker' }));
await write('draco-sequential', draco({ method: 'sequential' }));
